//! What the body does in one excursion of an angle: the evidence on which a protocol takes it for its own.
//!
//! Each change is the value at the peak minus the value at the base, the base being the mean of both ends when both were seen.
//! What needs places is `None` without a joint track; then angles alone decide.

use super::motion::{INTERVAL_S, Motion};
use super::transition::Excursion;
use crate::body::Side;

/// Share of an excursion of the knees above which the body is in its low part.
const LOW_PART: f64 = 0.75;

/// One excursion, as the whole body shows it. Arrays are by side.
#[derive(Debug, Clone, Copy)]
pub struct Look {
    /// The excursion.
    pub excursion: Excursion,
    /// Time from start to end, seconds.
    pub duration_s: f64,
    /// Knee flexion at the base, degrees.
    pub knee: [f64; 2],
    /// Change of knee flexion, degrees.
    pub knee_change: [f64; 2],
    /// Range of the difference of the knees within it, degrees: feet in turn, when it is as large as the change.
    pub knee_alternation: f64,
    /// Thigh against hanging, at the peak, degrees.
    pub thigh: [f64; 2],
    /// Change of the thigh, degrees.
    pub thigh_change: [f64; 2],
    /// Change of hip abduction, degrees.
    pub abduction_change: [f64; 2],
    /// What places tell.
    pub places: Option<PlacesLook>,
}

/// What places tell of an excursion; in leg lengths.
#[derive(Debug, Clone, Copy)]
pub struct PlacesLook {
    /// How far each foot rose at most.
    pub foot_rise: [f64; 2],
    /// How far each foot is forwards at the peak from where it began.
    pub foot_forward: [f64; 2],
    /// How far each foot ends from where it began.
    pub foot_left: [f64; 2],
    /// Distance of the feet at the peak: along the facing direction, and across it.
    pub feet_apart: [f64; 2],
    /// How far the body's weight is behind the ankles in the low part, as a negative number.
    pub balance: f64,
    /// How far the pelvis is forwards at the peak from where it began.
    pub pelvis_forward: f64,
    /// How far the hips sink at the peak.
    pub pelvis_drop: f64,
    /// How far the pelvis ends from where it began.
    pub travel: f64,
}

impl Look {
    /// The look of an excursion.
    pub fn at(motion: &Motion, excursion: Excursion) -> Self {
        let Excursion { start, peak, end, .. } = excursion;
        let base = |values: &[f64]| match (values[start], values[end]) {
            // Of an excursion that is cut off, the end that was seen is its base: the one farther from the peak.
            (first, last) if !excursion.is_complete => {
                let peak = values[peak];
                if (first - peak).abs() >= (last - peak).abs() { first } else { last }
            }
            (first, last) => 0.5 * (first + last),
        };
        let both = |values: &[Vec<f64>; 2], of: &dyn Fn(&[f64]) -> f64| [of(&values[0]), of(&values[1])];
        let change = |values: &[f64]| values[peak] - base(values);
        let differences = (start..=end).map(|i| motion.knee[0][i] - motion.knee[1][i]).filter(|d| d.is_finite());
        let [least, most] =
            differences.fold([f64::INFINITY, f64::NEG_INFINITY], |[least, most], d| [least.min(d), most.max(d)]);
        Self {
            excursion,
            duration_s: (end - start) as f64 * INTERVAL_S,
            knee: both(&motion.knee, &base),
            knee_alternation: most - least,
            knee_change: both(&motion.knee, &change),
            thigh: both(&motion.thigh, &|values| values[peak]),
            thigh_change: both(&motion.thigh, &change),
            abduction_change: both(&motion.abduction, &change),
            places: PlacesLook::at(motion, excursion),
        }
    }
}

impl PlacesLook {
    fn at(motion: &Motion, Excursion { start, peak, end, .. }: Excursion) -> Option<Self> {
        let places = motion.places.as_ref()?;
        let rise = |side: Side| {
            let ways = (start..=end).map(|i| places.foot_way(side, start, i)[1]);
            ways.filter(|way| way.is_finite()).fold(0.0, f64::max)
        };
        let knee = |i: usize| 0.5 * (motion.knee[0][i] + motion.knee[1][i]);
        let low = knee(start).min(knee(end));
        let is_low = |i: &usize| knee(*i) >= low + LOW_PART * (knee(peak) - low);
        let balance =
            (start..=end).filter(is_low).map(|i| places.balance[i]).filter(|b| b.is_finite()).fold(f64::NAN, f64::min);
        let travel = (places.pelvis[end] - places.pelvis[start]) / places.leg_length_m;
        let pelvis_way = (places.pelvis[peak] - places.pelvis[start]) / places.leg_length_m;
        let look = Self {
            pelvis_drop: -pelvis_way.y,
            pelvis_forward: pelvis_way.dot(&places.forward[start]),
            foot_rise: Side::BOTH.map(rise),
            foot_forward: Side::BOTH.map(|side| places.foot_way(side, start, peak)[0]),
            foot_left: Side::BOTH.map(|side| places.foot_way(side, start, end)[2]),
            feet_apart: places.feet_apart(peak),
            balance,
            travel: travel.x.hypot(travel.z),
        };
        look.is_known().then_some(look)
    }

    fn is_known(&self) -> bool {
        let numbers = [self.foot_forward, self.foot_left, self.feet_apart].concat();
        numbers.iter().chain([&self.balance, &self.travel]).all(|number| number.is_finite())
    }
}
