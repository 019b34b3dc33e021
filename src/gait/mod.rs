//! Footfalls and what they tell of gait: lengths, times, variability, symmetry, phases.
//!
//! Contacts come from joints of a camera that stands ([`measures_of_track`]) or from the depth pipeline, whose camera goes
//! along ([`measures_of_steps`]); definitions, exclusions and limits are those of the clinical evidence, sections 5 and 6.
//! `contact` says which steps count, `steps` what one step is, `summary` what all of them are; `track` finds contacts in a
//! track. A value is missing, with its reason, rather than invented.

pub mod contact;
mod depth;
pub mod plausibility;
mod spread;
pub mod steps;
pub mod summary;
mod track;

pub use contact::{GaitContact, StepExclusion, StepExclusionCount};
pub use plausibility::GaitFlag;
pub use spread::corrected_sd;
pub use summary::{HEEL_TO_OPPOSITE_LINE, PlaceDefinition, StepSelection};

use crate::assessment::gait::FLAT_FOOTPRINTS;
use crate::assessment::{Footfalls, Gait, JointTrack, PerformanceMeasure};
use track::Stepping;

/// What footfalls tell of gait.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct GaitFindings {
    /// Measures over the steps that count.
    pub measures: Vec<PerformanceMeasure>,
    /// The same over every step, also those that are left out.
    pub measures_of_all_steps: Vec<PerformanceMeasure>,
    /// Every contact, by time.
    pub contacts: Vec<GaitContact>,
    /// Steps that were left out, by reason.
    pub exclusions: Vec<StepExclusionCount>,
    /// Measures outside their plausible limits; they are kept.
    pub flags: Vec<GaitFlag>,
    /// Why nothing, or not everything, was found; empty when everything was.
    pub reason: String,
}

impl GaitFindings {
    /// The measures that count, and what is told beside them.
    pub fn into_parts(self) -> (Vec<PerformanceMeasure>, Footfalls) {
        let Self { measures, measures_of_all_steps, contacts, exclusions, flags, reason } = self;
        (measures, Footfalls { contacts, measures_of_all_steps, exclusions, flags, reason })
    }
}

/// Standard deviation of the constant difference between the errors of both ankles of a depth camera's skeleton, in each
/// axis, metres: 45 mm that stay and 30 mm that follow the posture, of a length in three axes, at each ankle.
const FOOT_OFFSET_SD_M: f64 = 0.044;
/// Standard deviation of the error of one step length and one step width beside that, metres: walks with the error of a
/// Kinect v2 (`surefoot evaluate gait`).
const PLACE_ERROR_SD_M: [f64; 2] = [0.003, 0.003];

/// Gait from where joints were before a camera that stands. Nothing for a movement that is no walking; times alone for
/// steps on the spot.
pub fn measures_of_track(track: &JointTrack) -> GaitFindings {
    let footfalls = track::footfalls(track);
    let reason = match footfalls.kind {
        Stepping::Walking if footfalls.has_backward => "walks that go backwards are left out",
        Stepping::Walking => "",
        Stepping::OnTheSpot => "the steps are on the spot: they have times, but no lengths, widths or speed",
        Stepping::None if footfalls.has_backward => "the walk goes backwards, which is not measured",
        Stepping::None => "there is no walking in the recording",
        Stepping::NoLegs => "the recording lacks pelvis or feet",
    };
    let places = match footfalls.kind {
        Stepping::Walking => PlaceDefinition {
            id: Some(FLAT_FOOTPRINTS),
            error_sd_m: Some(PLACE_ERROR_SD_M),
            offset_sd_m: Some(FOOT_OFFSET_SD_M),
        },
        _ => PlaceDefinition::default(),
    };
    findings(footfalls.contacts, &places, reason)
}

/// Measures of contacts whose places were measured by a definition; exclusions are marked here.
pub fn findings(mut contacts: Vec<GaitContact>, places: &PlaceDefinition, reason: &str) -> GaitFindings {
    contact::mark_excluded(&mut contacts);
    let all = match contacts.is_empty() {
        true => Vec::new(),
        false => summary::measures(&contacts, places, StepSelection::All),
    };
    let counted = match contacts.is_empty() {
        true => Vec::new(),
        false => summary::measures(&contacts, places, StepSelection::Counted),
    };
    assembled(counted, all, contacts, reason)
}

/// Gait from the steps of the depth pipeline.
pub fn measures_of_steps(gait: &Gait) -> GaitFindings {
    let contacts = depth::contacts(gait);
    if contacts.is_empty() {
        return GaitFindings { reason: "there are no steps in the recording".to_owned(), ..GaitFindings::default() };
    }
    let places = PlaceDefinition::default();
    let of = |selection: StepSelection| {
        let mut measures = depth::lengths(gait, selection == StepSelection::All);
        measures.extend(summary::measures(&contacts, &places, selection));
        measures
    };
    let (counted, all) = (of(StepSelection::Counted), of(StepSelection::All));
    assembled(counted, all, contacts, "")
}

fn assembled(
    measures: Vec<PerformanceMeasure>,
    measures_of_all_steps: Vec<PerformanceMeasure>,
    contacts: Vec<GaitContact>,
    reason: &str,
) -> GaitFindings {
    let mut reason = reason.to_owned();
    let has_none = measures.iter().all(|measure| measure.value.is_none());
    if reason.is_empty() && has_none {
        reason = "no step is left after the first and last two of each walk, turns, and steps that were hardly seen; record \
                  a longer walk"
            .to_owned();
    }
    GaitFindings {
        flags: plausibility::flags(&measures),
        exclusions: contact::count_excluded(&contacts),
        measures,
        measures_of_all_steps,
        contacts,
        reason,
    }
}
