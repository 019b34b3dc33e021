//! Parts of an assessment in the words of a page.

use crate::assessment::performance::{PerformanceMeasure, Repetition};
use crate::assessment::{ChannelSummary, Gait, Performance, PerformanceStatus, Quality};
use crate::pages::words;
use crate::report::measure::{title_of, unit_of};
use crate::storage::StoredAssessment;

/// Events that are listed one by one; all are in the download of the assessment.
const MOST_EVENTS: usize = 30;

/// How the exercise was performed.
pub(super) struct PerformanceView {
    pub protocol: String,
    pub status: &'static str,
    pub reason: String,
    pub recognized: String,
    pub repetitions: Vec<RepetitionRow>,
    pub measures: Vec<MeasureRow>,
}

/// A repetition.
pub(super) struct RepetitionRow {
    pub n: usize,
    pub side: &'static str,
    pub time: String,
    pub angle: String,
    pub extremes: String,
    pub speed: String,
    pub lean: String,
    pub seen: String,
    pub is_complete: bool,
}

/// A measure.
pub(super) struct MeasureRow {
    pub title: String,
    pub value: String,
    pub interval: String,
    pub n: String,
    pub definition: String,
    pub reason: String,
}

pub(super) fn performance(performance: &Performance) -> PerformanceView {
    let recognized: Vec<String> = performance.recognized.iter().map(|name| words::spoken(name)).collect();
    let version = performance.protocol_version.map_or_else(String::new, |version| format!(", rules version {version}"));
    PerformanceView {
        protocol: match &performance.protocol {
            Some(protocol) => format!("{}{version}", words::spoken(protocol)),
            None => "none declared".to_owned(),
        },
        status: match performance.status {
            PerformanceStatus::Measured => "Measured",
            PerformanceStatus::OtherMovement => "The movement is not the protocol's",
            PerformanceStatus::NotMeasured => "Not measured",
        },
        reason: words::sentence(&performance.reason),
        recognized: recognized.join(", "),
        repetitions: performance.repetitions.iter().enumerate().map(|(i, r)| RepetitionRow::of(i + 1, r)).collect(),
        measures: performance.measures.iter().map(MeasureRow::of).collect(),
    }
}

impl RepetitionRow {
    fn of(n: usize, repetition: &Repetition) -> Self {
        let [low, high] = repetition.extremes_deg;
        Self {
            n,
            side: repetition.side.map_or("both", |side| side.name()),
            time: format!("{:.2} to {:.2}\u{a0}s", repetition.start_s, repetition.end_s),
            angle: title_of(&repetition.channel),
            extremes: format!("{} to {}", words::quantity(low, "deg"), words::quantity(high, "deg")),
            speed: words::quantity(repetition.peak_velocity_deg_s, "deg/s"),
            lean: repetition.trunk_lean_deg.map_or_else(|| "not seen".to_owned(), |lean| words::quantity(lean, "deg")),
            seen: words::percent(repetition.coverage),
            is_complete: repetition.is_complete,
        }
    }
}

impl MeasureRow {
    fn of(measure: &PerformanceMeasure) -> Self {
        let unit = unit_of(&measure.name);
        let title = title_of(&measure.name);
        let interval = measure.value.and_then(|value| words::interval(value, measure.standard_error, unit));
        let no_interval = if measure.value.is_some() { "not known" } else { "" };
        Self {
            title: measure.side.map_or_else(|| title.clone(), |side| format!("{title}, {}", side.name())),
            value: measure.value.map_or_else(|| "no value".to_owned(), |value| words::quantity(value, unit)),
            interval: interval.unwrap_or_else(|| no_interval.to_owned()),
            n: measure.n_observations.map_or_else(|| "–".to_owned(), |n| n.to_string()),
            definition: measure.definition.clone().unwrap_or_default(),
            reason: words::sentence(&measure.reason),
        }
    }
}

/// Steps of a walk.
pub(super) struct GaitView {
    pub facts: Vec<(&'static str, String)>,
    pub excluded: String,
    pub summary: Vec<StepSummaryRow>,
    pub steps: Vec<StepRow>,
}

/// Mean and spread by one definition.
pub(super) struct StepSummaryRow {
    pub definition: String,
    pub n_steps: u64,
    pub length: String,
    pub width: String,
}

/// A step.
pub(super) struct StepRow {
    pub side: &'static str,
    pub landed: String,
    pub length: String,
    pub width: String,
    pub excluded: String,
}

impl GaitView {
    pub(super) fn of(gait: &Gait) -> Self {
        let known = |value: Option<String>| value.unwrap_or_else(|| "not known".to_owned());
        let facts = vec![
            ("Steps found", gait.steps.len().to_string()),
            ("Steps in the means", gait.n_steps_used.to_string()),
            ("Cadence", known(gait.cadence_per_min.map(|cadence| words::quantity(cadence, "{steps}/min")))),
            ("Double support", known(gait.double_support_share.map(words::percent))),
            ("Standing", words::seconds(gait.standing_s)),
        ];
        let excluded: Vec<String> =
            gait.excluded.iter().map(|e| format!("{} {}", e.n_steps, e.reason.replace('_', " "))).collect();
        let with_sd =
            |mean: f64, sd: f64| format!("{}, spread {}", words::quantity(mean, "m"), words::quantity(sd, "m"));
        let summary = gait.summary.iter().map(|summary| StepSummaryRow {
            definition: summary.definition.clone(),
            n_steps: summary.n_steps,
            length: with_sd(summary.length_mean_m, summary.length_sd_m),
            width: with_sd(summary.width_mean_m, summary.width_sd_m),
        });
        let definition = gait.summary.first().map(|summary| summary.definition.as_str());
        let steps = gait.steps.iter().map(|step| {
            let by = |m: &&crate::assessment::gait::StepMeasure| definition.is_none_or(|d| m.definition == d);
            let measure = step.measures.iter().find(by);
            let told = |value: f64, [low, high]: [f64; 2]| {
                format!("{} ({})", words::quantity(value, "m"), words::range(low, high, "m"))
            };
            StepRow {
                side: step.side.name(),
                landed: words::seconds(step.heel_strike_s),
                length: measure.map_or_else(|| "none".to_owned(), |m| told(m.length_m, m.length_interval_m)),
                width: measure.map_or_else(|| "none".to_owned(), |m| told(m.width_m, m.width_interval_m)),
                excluded: step.excluded_because.join(", ").replace('_', " "),
            }
        });
        Self { facts, excluded: excluded.join(", "), summary: summary.collect(), steps: steps.collect() }
    }
}

/// A channel in one line.
pub(super) struct ChannelRow {
    pub title: String,
    pub smallest: String,
    pub largest: String,
    pub range: String,
    pub interval_width: String,
    pub seen: String,
}

pub(super) fn channel_rows(summary: &[ChannelSummary]) -> Vec<ChannelRow> {
    let row = |channel: &ChannelSummary| {
        let unit = unit_of(&channel.channel);
        let told = |value: Option<f64>| value.map_or_else(|| "none".to_owned(), |value| words::quantity(value, unit));
        ChannelRow {
            title: title_of(&channel.channel),
            smallest: told(channel.min),
            largest: told(channel.max),
            range: told(channel.range),
            interval_width: told(channel.interval_width),
            seen: words::percent(channel.coverage),
        }
    };
    summary.iter().map(row).collect()
}

/// Something that went wrong.
pub(super) struct EventRow {
    pub kind: String,
    pub subject: String,
    pub time: String,
    pub n_frames: u64,
}

/// The first events and how many there are.
pub(super) fn event_rows(quality: &Quality) -> (Vec<EventRow>, usize) {
    let rows = quality.events.iter().take(MOST_EVENTS).map(|event| EventRow {
        kind: words::spoken(&event.kind),
        subject: event.subject.replace('_', " "),
        time: format!("{:.2} to {:.2}\u{a0}s", event.start_s, event.end_s),
        n_frames: event.n_frames,
    });
    (rows.collect(), quality.events.len())
}

/// The length of a segment.
pub(super) struct SegmentRow {
    pub segment: String,
    pub length: String,
    pub measured: String,
}

pub(super) fn segment_rows(quality: &Quality) -> Vec<SegmentRow> {
    let segments = quality.calibration.iter().flat_map(|calibration| &calibration.segments);
    let with_sd = |value: f64, sd: Option<f64>| match sd {
        Some(sd) => format!("{} ± {}", words::number(value), words::quantity(sd, "m")),
        None => words::quantity(value, "m"),
    };
    let row = segments.map(|segment| SegmentRow {
        segment: words::spoken(&segment.segment),
        length: with_sd(segment.length_m, segment.uncertainty_m),
        measured: segment.measured_m.map_or_else(|| "none".to_owned(), |m| with_sd(m, segment.measured_uncertainty_m)),
    });
    row.collect()
}

pub(super) fn provenance(assessment: &StoredAssessment) -> Vec<(&'static str, String)> {
    let provenance = &assessment.provenance;
    let noise_model = provenance.noise_model.as_ref().map(|model| match (model.version, &model.sha256) {
        (Some(version), Some(sha256)) => format!("{}@{version}, SHA-256 {sha256}", model.name),
        (Some(version), None) => format!("{}@{version}", model.name),
        (None, _) => model.name.clone(),
    });
    vec![
        ("Software", format!("Surefoot {}", provenance.software_version)),
        ("Pipeline", provenance.pipeline.clone()),
        ("Method", provenance.method.clone()),
        ("Noise model", noise_model.unwrap_or_else(|| "none".to_owned())),
        ("Seed", provenance.seed.to_string()),
        ("Recording, SHA-256", provenance.recording_sha256.clone()),
        ("Assessment", assessment.id.to_string()),
        ("Made", words::moment(assessment.created_at)),
    ]
}
