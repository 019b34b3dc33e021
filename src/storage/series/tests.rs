use super::*;
use crate::assessment::{Provenance, Quality};
use crate::storage::assessments::{self, EncodedAssessment};
use crate::storage::tests::Clinic;
use crate::storage::{AssessmentId, JobId, StorageError};
use proptest::prelude::*;

fn assessment(time_ns: Vec<i64>, series: Vec<Series>) -> Assessment {
    let summary = series.iter().map(Series::summarize).collect();
    let (quality, provenance) = (Quality::default(), Provenance::default());
    Assessment {
        pipeline: "joint_angles",
        time_ns,
        series,
        summary,
        gait: None,
        joints: None,
        performance: None,
        quality,
        provenance,
    }
}

/// Stores an assessment as the end of a job does.
async fn store_assessment(clinic: &Clinic, assessment: Assessment) -> AssessmentId {
    let recording = clinic.insert_recording(&clinic.admin, clinic.session).await.unwrap();
    let encoded = EncodedAssessment::encode(&assessment).unwrap();
    let job = JobId::new();
    let mut transaction = clinic.store.begin().await.unwrap();
    database::query(
        "INSERT INTO jobs (id, organisation_id, recording_id, state, max_attempts, settings, queued_at)
         SELECT $1, organisation_id, id, 'done', 1, '', 0 FROM recordings WHERE id = $2",
    )
    .bind(job)
    .bind(recording.id)
    .execute(&mut transaction)
    .await
    .unwrap();
    let now = clinic.store.now();
    let id = assessments::insert(&mut transaction, recording.id, job, &encoded, now).await.unwrap();
    transaction.commit().await.unwrap();
    id
}

/// A wave with gaps, an interval around it, and flags, of `n` samples that are 33 ms apart.
fn wave(channel: &str, n: usize, frequency: f32) -> Series {
    let value: Vec<f32> =
        (0..n).map(|i| if i % 97 == 5 { f32::NAN } else { 90.0 * (i as f32 * frequency).sin() }).collect();
    Series {
        channel: channel.into(),
        low: value.iter().map(|v| v - 2.0).collect(),
        high: value.iter().map(|v| v + 2.0).collect(),
        flags: (0..n).map(|i| (i % 5) as u8).collect(),
        value,
    }
}

fn times(n: usize) -> Vec<i64> {
    (0..n as i64).map(|i| 1_000_000_000 + i * 33_000_000).collect()
}

fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|v| v.to_bits()).collect()
}

fn any_bits() -> impl Strategy<Value = f32> {
    prop_oneof![any::<u32>().prop_map(f32::from_bits), Just(f32::NAN), Just(-0.0f32), -180.0f32..180.0]
}

proptest! {
    #[test]
    fn every_bit_of_a_chunk_survives_nan_included(
        samples in proptest::collection::vec((any_bits(), any_bits(), any_bits(), any::<u8>()), 1..600),
        start in any::<i64>(),
        steps in proptest::collection::vec(1i64..1_000_000_000_000, 600),
    ) {
        let n = samples.len();
        let mut series = Series::empty("x", n);
        for (i, (value, low, high, flags)) in samples.iter().enumerate() {
            (series.value[i], series.low[i], series.high[i], series.flags[i]) = (*value, *low, *high, *flags);
        }
        let time_ns: Vec<i64> = steps[..n].iter().scan(start, |t, step| { *t = t.wrapping_add(*step); Some(*t) }).collect();
        let chunk = codec::Encoder::new().unwrap().encode_series(&series, 0..n).unwrap();
        let time = codec::Encoder::new().unwrap().encode_time(&time_ns).unwrap();
        let mut decoder = codec::Decoder::new().unwrap();
        let (mut value, mut low, mut high, mut flags, mut times) = (vec![], vec![], vec![], vec![], vec![]);
        decoder.decode_f32(&chunk.value, n, &mut value).unwrap();
        decoder.decode_f32(&chunk.low, n, &mut low).unwrap();
        decoder.decode_f32(&chunk.high, n, &mut high).unwrap();
        decoder.decode_u8(&chunk.flags, n, &mut flags).unwrap();
        decoder.decode_time(&time.bytes, n, &mut times).unwrap();
        prop_assert_eq!(bits(&value), bits(&series.value));
        prop_assert_eq!(bits(&low), bits(&series.low));
        prop_assert_eq!(bits(&high), bits(&series.high));
        prop_assert_eq!(flags, series.flags);
        prop_assert_eq!(times, time_ns);
        let finite: Vec<f64> = series.value.iter().filter(|v| v.is_finite()).map(|v| f64::from(*v)).collect();
        let range = (!finite.is_empty()).then(|| finite.iter().fold((f64::MAX, f64::MIN), |(a, b), v| (a.min(*v), b.max(*v))));
        prop_assert_eq!(chunk.value_range, range);
    }

    #[test]
    fn a_damaged_chunk_is_an_error_and_no_panic(byte in any::<prop::sample::Index>(), bit in 0u8..8, cut in any::<bool>()) {
        let series = wave("x", 500, 0.01);
        let chunk = codec::Encoder::new().unwrap().encode_series(&series, 0..500).unwrap();
        let mut damaged = chunk.value.clone();
        let place = byte.index(damaged.len());
        if cut { damaged.truncate(place) } else { damaged[place] ^= 1 << bit }
        let mut value = vec![];
        let decoded = codec::Decoder::new().unwrap().decode_f32(&damaged, 500, &mut value);
        // A bit of the frame's header that says nothing may change; the values may not.
        prop_assert!(decoded.is_err() || bits(&value) == bits(&series.value));
    }
}

#[tokio::test]
async fn series_of_several_chunks_come_back_bit_by_bit_in_the_order_asked_for() {
    let clinic = Clinic::open().await;
    let n = 2 * CHUNK_SAMPLES + 17;
    let waves = [wave("a_deg", n, 0.01), wave("b_deg", n, 0.02), wave("c_deg", n, 0.05)];
    let id = store_assessment(&clinic, assessment(times(n), waves.to_vec())).await;
    let query = SeriesQuery { channels: Some(vec!["c_deg".into(), "a_deg".into()]), ..SeriesQuery::default() };
    let slice = clinic.store.series_of_assessment(&clinic.admin, id, &query).await.unwrap();
    assert_eq!((slice.n_in_range, &slice.time_ns), (n, &times(n)));
    for (found, stored) in slice.series.iter().zip([&waves[2], &waves[0]]) {
        assert_eq!(found.channel, stored.channel);
        assert_eq!(bits(&found.value), bits(&stored.value));
        assert_eq!(bits(&found.low), bits(&stored.low));
        assert_eq!(bits(&found.high), bits(&stored.high));
        assert_eq!(found.flags, stored.flags);
    }
}

#[tokio::test]
async fn a_time_range_cuts_between_samples_and_across_chunks() {
    let clinic = Clinic::open().await;
    let n = 2 * CHUNK_SAMPLES + 17;
    let all = wave("a_deg", n, 0.01);
    let id = store_assessment(&clinic, assessment(times(n), vec![all.clone()])).await;
    let time = times(n);
    for (first, last) in [(0, n - 1), (4090, 4100), (CHUNK_SAMPLES, CHUNK_SAMPLES), (n - 3, n - 1), (5, 5)] {
        let query = SeriesQuery { from_ns: Some(time[first] - 1), to_ns: Some(time[last]), ..SeriesQuery::default() };
        let slice = clinic.store.series_of_assessment(&clinic.admin, id, &query).await.unwrap();
        assert_eq!(slice.time_ns, time[first..=last]);
        assert_eq!(bits(&slice.series[0].value), bits(&all.value[first..=last]));
        assert_eq!(slice.series[0].flags, all.flags[first..=last]);
    }
    for (from_ns, to_ns) in [(Some(i64::MAX), None), (None, Some(0)), (Some(time[9]), Some(time[8]))] {
        let query = SeriesQuery { from_ns, to_ns, ..SeriesQuery::default() };
        let slice = clinic.store.series_of_assessment(&clinic.admin, id, &query).await.unwrap();
        assert_eq!((slice.n_in_range, slice.time_ns.len(), slice.series[0].value.len()), (0, 0, 0));
    }
}

#[tokio::test]
async fn a_thinned_out_series_holds_real_samples_with_their_intervals_and_its_peak() {
    let clinic = Clinic::open().await;
    let n = CHUNK_SAMPLES + 900;
    let mut all = wave("a_deg", n, 0.003);
    all.value[4321] = 171.0;
    let id = store_assessment(&clinic, assessment(times(n), vec![all.clone(), wave("b_deg", n, 0.1)])).await;
    let query = SeriesQuery { max_points: Some(100), ..SeriesQuery::default() };
    let slice = clinic.store.series_of_assessment(&clinic.admin, id, &query).await.unwrap();
    assert_eq!((slice.time_ns.len(), slice.n_in_range), (100, n));
    let time = times(n);
    for (k, t) in slice.time_ns.iter().enumerate() {
        let i = time.binary_search(t).unwrap();
        assert_eq!(slice.series[0].value[k].to_bits(), all.value[i].to_bits());
        assert_eq!(slice.series[0].high[k].to_bits(), all.high[i].to_bits());
        assert_eq!(slice.series[0].flags[k], all.flags[i]);
    }
    assert!(slice.series[0].value.contains(&171.0));
}

#[tokio::test]
async fn parts_that_were_not_asked_for_stay_empty() {
    let clinic = Clinic::open().await;
    let id = store_assessment(&clinic, assessment(times(50), vec![wave("a_deg", 50, 0.1)])).await;
    let parts = Parts { interval: false, flags: false };
    let query = SeriesQuery { parts, max_points: Some(10), ..SeriesQuery::default() };
    let slice = clinic.store.series_of_assessment(&clinic.admin, id, &query).await.unwrap();
    let series = &slice.series[0];
    assert_eq!((series.value.len(), series.low.len(), series.high.len(), series.flags.len()), (10, 0, 0, 0));
}

#[tokio::test]
async fn an_assessment_without_samples_has_empty_series() {
    let clinic = Clinic::open().await;
    let id = store_assessment(&clinic, assessment(vec![], vec![Series::empty("a_deg", 0)])).await;
    let slice = clinic.store.series_of_assessment(&clinic.admin, id, &SeriesQuery::default()).await.unwrap();
    assert_eq!((slice.series.len(), slice.n_in_range), (1, 0));
}

#[tokio::test]
async fn unknown_channels_and_missing_chunks_are_told_apart() {
    let clinic = Clinic::open().await;
    let id = store_assessment(&clinic, assessment(times(50), vec![wave("a_deg", 50, 0.1)])).await;
    let query = SeriesQuery { channels: Some(vec!["no_such_deg".into()]), ..SeriesQuery::default() };
    let unknown = clinic.store.series_of_assessment(&clinic.admin, id, &query).await;
    assert!(matches!(unknown, Err(StorageError::NotFound { what: "channel" })), "{unknown:?}");
    let mut transaction = clinic.store.begin().await.unwrap();
    database::query("DELETE FROM series_chunks").execute(&mut transaction).await.unwrap();
    transaction.commit().await.unwrap();
    let missing = clinic.store.series_of_assessment(&clinic.admin, id, &SeriesQuery::default()).await;
    assert!(matches!(missing, Err(StorageError::Corrupt(_))), "{missing:?}");
}
