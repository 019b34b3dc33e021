//! Series of an assessment as Observations with sampled data.

use super::{DEVICE_ID, MEASURE_SYSTEM, instant, patient_reference, quantity, reference};
use crate::report::export::Samples;
use crate::report::measure::{title_of, unit_of};
use crate::signal::interpolation::interpolate;
use serde_json::{Value, json};
use std::fmt::Write;
use time::OffsetDateTime;
use uuid::Uuid;

/// Most samples of a series in a bundle; longer ones are read as CSV.
const MOST_SAMPLES: usize = 10_000;
/// What FHIR writes where there is no value.
const NO_VALUE: &str = "E";

/// Whose series they are, and when they were recorded.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SeriesOrigin {
    /// The patient.
    pub patient: Uuid,
    /// The assessment.
    pub assessment: Uuid,
    /// When the recording's session began.
    pub recorded_at: OffsetDateTime,
    /// When the assessment was stored.
    pub created_at: OffsetDateTime,
}

/// A collection with one Observation for each channel. Sampled data have one period: the samples are read between those of
/// the assessment at its mean rate, or as much of it as makes ten thousand samples.
pub fn series_bundle(samples: &Samples, origin: &SeriesOrigin, base: &str) -> Value {
    let n = samples.time_ns.len().min(MOST_SAMPLES);
    let [first, last] = [samples.time_ns.first(), samples.time_ns.last()].map(|t| t.copied().unwrap_or_default());
    let period_ns = if n > 1 { (last - first) as f64 / (n - 1) as f64 } else { 0.0 };
    let times: Vec<i64> = (0..n).map(|i| first + (i as f64 * period_ns).round() as i64).collect();
    let entries = samples.series.iter().enumerate().map(|(channel, series)| {
        let values: Vec<f64> = series.value.iter().map(|value| f64::from(*value)).collect();
        let mut data = String::with_capacity(8 * n);
        for (i, time_ns) in times.iter().enumerate() {
            let separator = if i > 0 { " " } else { "" };
            let value = interpolate(&samples.time_ns, &values, *time_ns);
            let _ = match value.is_finite() {
                true => write!(data, "{separator}{value:.4}"),
                false => write!(data, "{separator}{NO_VALUE}"),
            };
        }
        let resource = observation(&series.channel, channel, origin, period_ns * 1e-6, &data);
        json!({"fullUrl": format!("{base}/Observation/{}", id_of(origin, channel)), "resource": resource})
    });
    let entries: Vec<Value> = entries.collect();
    let mut bundle = json!({"resourceType": "Bundle", "type": "collection", "timestamp": instant(origin.created_at)});
    if !entries.is_empty() {
        bundle["entry"] = Value::Array(entries);
    }
    bundle
}

fn id_of(origin: &SeriesOrigin, channel: usize) -> String {
    format!("{}-{channel}", origin.assessment)
}

fn observation(name: &str, channel: usize, origin: &SeriesOrigin, period_ms: f64, data: &str) -> Value {
    let unit = unit_of(name);
    let mut zero = quantity(0.0, unit);
    zero["value"] = json!(0);
    let mut resource = json!({
        "resourceType": "Observation",
        "id": id_of(origin, channel),
        "status": "final",
        "category": [{"coding": [{
            "system": "http://terminology.hl7.org/CodeSystem/observation-category", "code": "exam", "display": "Exam",
        }]}],
        "code": {"coding": [{"system": MEASURE_SYSTEM, "code": name}], "text": title_of(name)},
        "subject": patient_reference(origin.patient),
        "effectiveDateTime": instant(origin.recorded_at),
        "issued": instant(origin.created_at),
        "device": reference("Device", DEVICE_ID),
    });
    if !data.is_empty() {
        resource["valueSampledData"] = json!({"origin": zero, "period": period_ms, "dimensions": 1, "data": data});
    }
    resource
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assessment::Series;

    #[test]
    fn uneven_samples_get_one_period_and_a_missing_value_its_letter() {
        let mut series = Series::empty("left_knee_flexion_deg", 4);
        series.value = vec![0.0, 10.0, f32::NAN, 40.0];
        let samples = Samples { time_ns: vec![0, 10_000_000, 20_000_000, 40_000_000], series: vec![series] };
        let at = OffsetDateTime::UNIX_EPOCH;
        let origin = SeriesOrigin { patient: Uuid::nil(), assessment: Uuid::nil(), recorded_at: at, created_at: at };
        let bundle = series_bundle(&samples, &origin, "/fhir/R4");
        let sampled = &bundle["entry"][0]["resource"]["valueSampledData"];
        assert_eq!(sampled["origin"]["unit"], "deg");
        assert!((sampled["period"].as_f64().unwrap() - 40.0 / 3.0).abs() < 1e-6);
        let values: Vec<&str> = sampled["data"].as_str().unwrap().split(' ').collect();
        assert_eq!((values.len(), values[0], values[3]), (4, "0.0000", "40.0000"));
        assert!(values.contains(&"E"), "{values:?}");
    }
}
