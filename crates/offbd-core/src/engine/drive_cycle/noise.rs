//! Deterministic pseudo-random noise, so that equal rigs get equal cycles.

#[cfg(not(feature = "std"))]
use crate::no_std::*;

/// The mixing function of SplitMix64 (Steele, Lea & Flood 2014), scaled to [0, 1).
pub(super) fn uniform(stream: u64, index: u64) -> f64 {
    let mut z = index
        .wrapping_mul(0x9e37_79b9_7f4a_7c15)
        .wrapping_add(stream.wrapping_mul(0xd1b5_4a32_d192_ed03))
        .wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
}

/// Returns noise with mean zero and standard deviation one, within ±3.5: the sum of four
/// uniform numbers, whose variance is a third.
pub(super) fn normal(stream: u64, index: u64) -> f64 {
    let sum: f64 = (0..4).map(|k| uniform(stream.wrapping_mul(4).wrapping_add(k), index)).sum();
    (sum - 2.0) * 3.0_f64.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_has_no_mean_unit_spread_and_no_memory() {
        let n = 20_000;
        for stream in [0, 1, 9] {
            let x: Vec<f64> = (0..n).map(|i| normal(stream, i)).collect();
            let mean = x.iter().sum::<f64>() / n as f64;
            let variance = x.iter().map(|v| v * v).sum::<f64>() / n as f64;
            let next = x.windows(2).map(|w| w[0] * w[1]).sum::<f64>() / n as f64;
            // Four standard errors of each.
            assert!(mean.abs() < 0.03 && (variance - 1.0).abs() < 0.04 && next.abs() < 0.03);
        }
    }
}
