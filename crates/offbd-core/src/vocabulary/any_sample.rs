//! Samples for property tests.

use proptest::prelude::*;

use super::Sample;

/// Samples with a sequence number of `seq` or none, a time of `number`, and readings of `number`
/// or none.
pub fn any_sample<N: Strategy<Value = f64>>(
    seq: impl Strategy<Value = u64>,
    number: impl Fn() -> N,
) -> impl Strategy<Value = Sample> {
    let reading = || proptest::option::of(number());
    (proptest::option::of(seq), number(), reading(), reading(), reading(), reading()).prop_map(
        |(seq, t_s, cmd_qx_rad, cmd_qy_rad, x_m, y_m)| Sample {
            seq,
            t_s,
            cmd_qx_rad,
            cmd_qy_rad,
            x_m,
            y_m,
        },
    )
}
