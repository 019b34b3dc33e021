//! What a patient is to train at home, and how much of it was done.

use serde::{Deserialize, Serialize};
use time::{Duration, OffsetDateTime};
use utoipa::ToSchema;

/// Days that adherence looks back over: four weeks.
const WINDOW_DAYS: i64 = 28;
/// Days of a week.
const WEEK_DAYS: f64 = 7.0;
/// Most sessions a week and exercises of a plan, and most of what an exercise asks for.
const MOST_SESSIONS: u32 = 21;
const MOST_EXERCISES: usize = 30;
const MOST_REPETITIONS: u32 = 1000;
const LONGEST_NAME: usize = 64;

/// What a patient is to train.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct TrainingPlan {
    /// Sessions a week.
    #[schema(minimum = 1, maximum = 21)]
    pub sessions_per_week: u32,
    /// Exercises of each session.
    #[schema(min_items = 1, max_items = 30)]
    pub exercises: Vec<PlannedExercise>,
}

/// One exercise of a plan.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct PlannedExercise {
    /// The protocol, as sessions and recordings name it, for example `back_knee`.
    #[schema(min_length = 1, max_length = 64, example = "back_knee")]
    pub protocol: String,
    /// Repetitions in each session; null leaves them open.
    #[serde(default)]
    #[schema(minimum = 1, maximum = 1000)]
    pub repetitions: Option<u32>,
}

impl TrainingPlan {
    /// What cannot be, the path of the field and a sentence each.
    pub fn impossible(&self) -> Vec<(String, String)> {
        let mut found = Vec::new();
        if !(1..=MOST_SESSIONS).contains(&self.sessions_per_week) {
            found.push(("sessions_per_week".to_owned(), format!("must be between 1 and {MOST_SESSIONS}")));
        }
        if !(1..=MOST_EXERCISES).contains(&self.exercises.len()) {
            found.push(("exercises".to_owned(), format!("must hold between 1 and {MOST_EXERCISES} exercises")));
        }
        for (i, exercise) in self.exercises.iter().enumerate() {
            let length = exercise.protocol.chars().count();
            if !(1..=LONGEST_NAME).contains(&length) || exercise.protocol.chars().any(char::is_control) {
                let sentence =
                    format!("must have between 1 and {LONGEST_NAME} characters, none of them a control character");
                found.push((format!("exercises[{i}].protocol"), sentence));
            }
            if exercise.repetitions.is_some_and(|n| !(1..=MOST_REPETITIONS).contains(&n)) {
                found
                    .push((format!("exercises[{i}].repetitions"), format!("must be between 1 and {MOST_REPETITIONS}")));
            }
            if self.exercises[..i].iter().any(|earlier| earlier.protocol == exercise.protocol) {
                found.push((format!("exercises[{i}].protocol"), "stands in the plan twice".to_owned()));
            }
        }
        found
    }
}

/// A session that was held, as adherence counts it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TrainedSession {
    /// When it began.
    pub started_at: OffsetDateTime,
    /// Protocols of its recordings, and the repetitions that were found in each; none where none could be counted.
    pub exercises: Vec<(String, Option<u32>)>,
}

/// How much of a plan was done in the four weeks before a time, or since the plan when it is newer.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Adherence {
    /// First moment that counts.
    #[serde(with = "time::serde::rfc3339")]
    pub from: OffsetDateTime,
    /// Sessions that the plan asks for in that time; a part of a week counts as a part.
    pub planned_sessions: f64,
    /// Sessions with a recording in that time.
    pub done_sessions: u64,
    /// `done / planned`, in percent, 100 at most; null while the plan is younger than the time of one session.
    pub done_pct: Option<f64>,
    /// Each exercise of the plan.
    pub exercises: Vec<ExerciseAdherence>,
}

/// How much of one exercise was done.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct ExerciseAdherence {
    /// The protocol.
    pub protocol: String,
    /// Sessions in which it was recorded.
    pub done_sessions: u64,
    /// Sessions of those in which at least the planned repetitions were counted; null when the plan asks for no number.
    pub complete_sessions: Option<u64>,
    /// Sessions of those in which repetitions could not be counted.
    pub uncounted_sessions: u64,
}

impl Adherence {
    /// The first moment that counts for a plan that was made at `planned_at`, up to `by`.
    pub fn window_start(planned_at: OffsetDateTime, by: OffsetDateTime) -> OffsetDateTime {
        planned_at.max(by - Duration::days(WINDOW_DAYS))
    }

    /// Counts the sessions of a patient against the plan that was made at `planned_at`, up to `by`.
    pub fn of(
        plan: &TrainingPlan,
        planned_at: OffsetDateTime,
        by: OffsetDateTime,
        sessions: &[TrainedSession],
    ) -> Self {
        let from = Self::window_start(planned_at, by);
        let weeks = (by - from).as_seconds_f64().max(0.0) / (WEEK_DAYS * 86_400.0);
        let planned_sessions = weeks * f64::from(plan.sessions_per_week);
        let counted = || {
            let in_time = |s: &&TrainedSession| s.started_at >= from && s.started_at <= by && !s.exercises.is_empty();
            sessions.iter().filter(in_time)
        };
        let done_sessions = counted().count() as u64;
        let exercises = plan.exercises.iter().map(|exercise| {
            // Of an exercise that was recorded twice in a session, all repetitions count.
            let in_session = |session: &TrainedSession| {
                let own = session.exercises.iter().filter(|(protocol, _)| *protocol == exercise.protocol);
                let counts: Vec<Option<u32>> = own.map(|(_, n)| *n).collect();
                (!counts.is_empty()).then(|| counts.into_iter().sum::<Option<u32>>())
            };
            let done: Vec<Option<u32>> = counted().filter_map(in_session).collect();
            let complete = |planned: u32| done.iter().filter(|n| n.is_some_and(|n| n >= planned)).count() as u64;
            ExerciseAdherence {
                protocol: exercise.protocol.clone(),
                done_sessions: done.len() as u64,
                complete_sessions: exercise.repetitions.map(complete),
                uncounted_sessions: done.iter().filter(|n| n.is_none()).count() as u64,
            }
        });
        Self {
            from,
            planned_sessions,
            done_sessions,
            done_pct: (planned_sessions >= 1.0).then(|| (100.0 * done_sessions as f64 / planned_sessions).min(100.0)),
            exercises: exercises.collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn day(n: i64) -> OffsetDateTime {
        OffsetDateTime::UNIX_EPOCH + Duration::days(n)
    }

    fn plan() -> TrainingPlan {
        let exercise = |protocol: &str, repetitions| PlannedExercise { protocol: protocol.to_owned(), repetitions };
        TrainingPlan { sessions_per_week: 3, exercises: vec![exercise("back_knee", Some(10)), exercise("walk", None)] }
    }

    fn session(at: i64, exercises: &[(&str, Option<u32>)]) -> TrainedSession {
        let exercises = exercises.iter().map(|(name, n)| ((*name).to_owned(), *n)).collect();
        TrainedSession { started_at: day(at), exercises }
    }

    #[test]
    fn sessions_of_the_last_four_weeks_count_against_the_plan() {
        let sessions = [
            session(50, &[("back_knee", Some(12))]),
            session(80, &[("back_knee", Some(6)), ("back_knee", Some(5)), ("walk", None)]),
            session(90, &[("back_knee", Some(4))]),
            session(95, &[]),
            session(99, &[("back_knee", None)]),
        ];
        let found = Adherence::of(&plan(), day(0), day(100), &sessions);
        assert_eq!((found.from, found.planned_sessions, found.done_sessions), (day(72), 12.0, 3));
        assert_eq!(found.done_pct, Some(25.0));
        let [knee, walk] = &found.exercises[..] else { panic!("two exercises") };
        assert_eq!((knee.done_sessions, knee.complete_sessions, knee.uncounted_sessions), (3, Some(1), 1));
        assert_eq!((walk.done_sessions, walk.complete_sessions), (1, None));
    }

    #[test]
    fn a_plan_of_today_says_nothing_yet() {
        let found = Adherence::of(&plan(), day(100), day(100), &[]);
        assert_eq!((found.planned_sessions, found.done_pct), (0.0, None));
    }

    #[test]
    fn a_plan_that_cannot_be_is_refused_by_field() {
        assert_eq!(plan().impossible(), []);
        let twice = TrainingPlan { sessions_per_week: 0, exercises: [plan().exercises, plan().exercises].concat() };
        let paths: Vec<String> = twice.impossible().into_iter().map(|(path, _)| path).collect();
        assert_eq!(paths, ["sessions_per_week", "exercises[2].protocol", "exercises[3].protocol"]);
    }
}
