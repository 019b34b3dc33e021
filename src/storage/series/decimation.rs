//! Fewer samples for a picture, all of them real.
//!
//! All channels share one time axis, so one set of samples is chosen for all. A clinician reads peaks, so the extremes
//! of each channel are kept first; each bucket of the rest gives the sample that lies farthest from its bucket's mean,
//! summed over the channels in units of each channel's range. Averages are never made: a sample keeps its interval and
//! its flags.

/// One channel, and the range of its values that scales it against the others.
pub(super) struct Column<'a> {
    pub(super) values: &'a [f32],
    pub(super) value_range: Option<(f64, f64)>,
}

/// Increasing indices of at most `most` of the `n` samples.
pub(super) fn choose(n: usize, columns: &[Column<'_>], most: usize) -> Vec<usize> {
    if most >= n {
        return (0..n).collect();
    }
    let mut chosen = vec![false; n];
    let mut left = most;
    let keep = |i: usize, chosen: &mut Vec<bool>, left: &mut usize| {
        if *left > 0 && !chosen[i] {
            chosen[i] = true;
            *left -= 1;
        }
    };
    if n > 0 {
        keep(0, &mut chosen, &mut left);
        keep(n - 1, &mut chosen, &mut left);
    }
    for column in columns {
        for extreme in extremes(column.values) {
            keep(extreme, &mut chosen, &mut left);
        }
    }
    let scores = scores(n, columns, left);
    for bucket in 0..left {
        let (start, end) = (bucket * n / left, (bucket + 1) * n / left);
        // The first of equal samples, so that the choice is the same everywhere.
        let best = (start..end).filter(|&i| !chosen[i]).reduce(|a, b| if scores[b] > scores[a] { b } else { a });
        if let Some(best) = best {
            chosen[best] = true;
        }
    }
    (0..n).filter(|&i| chosen[i]).collect()
}

/// Where the smallest and the largest finite value stand.
fn extremes(values: &[f32]) -> impl Iterator<Item = usize> {
    let finite = || values.iter().enumerate().filter(|(_, v)| v.is_finite());
    let smallest = finite().reduce(|a, b| if b.1 < a.1 { b } else { a });
    let largest = finite().reduce(|a, b| if b.1 > a.1 { b } else { a });
    smallest.into_iter().chain(largest).map(|(i, _)| i)
}

/// How much each sample stands out of its bucket.
fn scores(n: usize, columns: &[Column<'_>], buckets: usize) -> Vec<f64> {
    let mut scores = vec![0.0; n];
    for column in columns {
        let Some((min, max)) = column.value_range else { continue };
        if max <= min {
            continue;
        }
        let scale = 1.0 / (max - min);
        for bucket in 0..buckets {
            let (start, end) = (bucket * n / buckets, (bucket + 1) * n / buckets);
            let values = &column.values[start..end];
            let finite = || values.iter().filter(|v| v.is_finite()).map(|v| f64::from(*v));
            let mean = finite().sum::<f64>() / finite().count().max(1) as f64;
            for (score, value) in scores[start..end].iter_mut().zip(values) {
                if value.is_finite() {
                    *score += (f64::from(*value) - mean).abs() * scale;
                }
            }
        }
    }
    scores
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn column(values: &[f32]) -> Column<'_> {
        let finite = || values.iter().filter(|v| v.is_finite()).map(|v| f64::from(*v));
        let range = (finite().fold(f64::INFINITY, f64::min), finite().fold(f64::NEG_INFINITY, f64::max));
        Column { values, value_range: finite().next().map(|_| range) }
    }

    #[test]
    fn a_single_peak_between_many_flat_samples_is_kept() {
        let mut values = vec![10.0f32; 10_000];
        values[7_123] = 95.0;
        values[7_124] = f32::NAN;
        let chosen = choose(values.len(), &[column(&values)], 50);
        assert!(chosen.contains(&7_123) && chosen.contains(&0) && chosen.contains(&9_999));
        assert_eq!(chosen.len(), 50);
    }

    #[test]
    fn every_channel_keeps_its_extremes_on_the_common_axis() {
        let waves: Vec<Vec<f32>> =
            (1..=19).map(|k| (0..18_000).map(|i| (i as f32 * 0.001 * k as f32).sin() * k as f32).collect()).collect();
        let columns: Vec<Column<'_>> = waves.iter().map(|wave| column(wave)).collect();
        let chosen = choose(18_000, &columns, 500);
        for wave in &waves {
            let max = |values: &mut dyn Iterator<Item = f32>| values.fold(f32::NEG_INFINITY, f32::max);
            assert_eq!(max(&mut chosen.iter().map(|&i| wave[i])), max(&mut wave.iter().copied()));
        }
    }

    proptest! {
        #[test]
        fn the_choice_increases_and_has_the_size_that_was_asked_for(
            values in proptest::collection::vec(prop_oneof![4 => -180.0f32..180.0, 1 => Just(f32::NAN)], 0..300),
            most in 0usize..320,
        ) {
            let chosen = choose(values.len(), &[column(&values)], most);
            prop_assert!(chosen.is_sorted_by(|a, b| a < b));
            prop_assert!(chosen.len() <= most.min(values.len()));
            // Buckets whose every sample is chosen already may give none.
            prop_assert!(chosen.len() + 4 >= most.min(values.len()));
        }
    }
}
