//! The catalogue: one file for each exercise or test, and one line here.

mod alternate_step;
mod back_knee;
mod chair_stand_30_s;
mod five_times_sit_to_stand;
mod held;
mod knee_lift;
mod leg_raise;
mod lunge;
mod march;
mod near_tandem;
mod semi_tandem_stand;
mod side_by_side_stand;
mod side_hip;
mod side_lunge;
mod sit_front_knee;
mod squat;
mod step;
mod tandem_stand;
mod walk;
mod walk_with_walker;

use super::Protocol;

/// Every exercise and test that recordings are compared with.
pub static PROTOCOLS: &[&Protocol] = &[
    &five_times_sit_to_stand::PROTOCOL,
    &chair_stand_30_s::PROTOCOL,
    &alternate_step::PROTOCOL,
    &near_tandem::PROTOCOL,
    &tandem_stand::PROTOCOL,
    &semi_tandem_stand::PROTOCOL,
    &side_by_side_stand::PROTOCOL,
    &walk::PROTOCOL,
    &walk_with_walker::PROTOCOL,
    &back_knee::PROTOCOL,
    &sit_front_knee::PROTOCOL,
    &side_hip::PROTOCOL,
    &step::PROTOCOL,
    &squat::PROTOCOL,
    &knee_lift::PROTOCOL,
    &leg_raise::PROTOCOL,
    &lunge::PROTOCOL,
    &side_lunge::PROTOCOL,
    &march::PROTOCOL,
];
