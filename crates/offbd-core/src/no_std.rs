//! Replacements for the standard library's prelude and `f64` methods: the collections of
//! `alloc`, and the functions of `libm` through `num_traits::Float`.

pub(crate) use alloc::borrow::ToOwned;
pub(crate) use alloc::boxed::Box;
pub(crate) use alloc::format;
pub(crate) use alloc::string::{String, ToString};
pub(crate) use alloc::vec;
pub(crate) use alloc::vec::Vec;
pub(crate) use num_traits::Float as _;
