//! What the parsers use of the support of the tests.

#![allow(dead_code, reason = "the tests use the rest")]

#[path = "../../tests/it/support/provider/tokens.rs"]
pub mod provider;
#[path = "../../tests/it/support/workbook.rs"]
pub mod workbook;
