//! The test vectors of the rules, named by rule, and what holds of all of them.

use super::*;

fn finding(id: &str, known: &Known) -> Finding {
    findings(known).into_iter().find(|finding| finding.rule_id == id).expect("the rule")
}

fn of_population() -> Person {
    Person {
        age_years: Some(75.0),
        sex: Some(Sex::Female),
        uses_walking_aid: Some(false),
        lives_in_community: Some(true),
    }
}

fn seconds(value: f64) -> Option<Measured> {
    Some(Measured::of(value))
}

fn measured(measures: Measures) -> Known {
    Known { person: of_population(), measures, ..Known::default() }
}

#[test]
fn every_threshold_belongs_to_a_rule_with_a_source() {
    let mut ids: Vec<&str> = RULES.iter().map(|rule| rule.info.id).collect();
    ids.sort_unstable();
    ids.dedup();
    assert_eq!(ids.len(), RULES.len(), "an id is used twice");
    for rule in RULES {
        let RuleInfo { id, version, statement, population, citation, accuracy, cutoffs, evidence, .. } = rule.info;
        assert!(version > 0 && !statement.is_empty(), "{id}");
        assert!(!population.is_empty() && !citation.is_empty() && !accuracy.is_empty(), "{id}");
        // A rule is no better confirmed than the weakest of its limits.
        let weakest = cutoffs.iter().any(|cutoff| cutoff.evidence == Evidence::Unconfirmed);
        assert!(!weakest || evidence == Evidence::Unconfirmed, "{id} hides an unconfirmed limit");
    }
}

#[test]
fn of_a_person_of_whom_nothing_is_known_nothing_is_negative() {
    for finding in findings(&Known::default()) {
        let status = finding.status.expect("a status");
        assert!(matches!(status, Status::Unknown | Status::NotAssessable), "{}: {status:?}", finding.rule_id);
        assert_eq!(finding.probability, None, "{}", finding.rule_id);
        assert!(!finding.reason.is_empty(), "{}", finding.rule_id);
    }
}

#[test]
fn quickscreen_with_two_items_present_one_absent_and_five_unknown_is_0_13_to_0_49() {
    let known = measured(Measures {
        near_tandem_hold_s: seconds(6.0),
        five_times_sit_to_stand_s: seconds(14.0),
        alternate_step_s: seconds(8.0),
        ..Measures::default()
    });
    let found = finding("quickscreen", &known);
    assert_eq!((found.value, found.probability), (Some(2.0), Some([0.13, 0.49])));
    assert_eq!(found.status, Some(Status::Unknown));
    assert!(found.reason.contains("near_tandem, sit_to_stand_5"), "{}", found.reason);
}

#[test]
fn quickscreen_with_all_eight_known_and_one_present_is_0_07() {
    let answers = Answers {
        falls_12_months: Some(1),
        medicines: Some(3),
        takes_psychotropic: Some(false),
        reads_low_contrast_line_10: Some(true),
        feels_ankle_filament: Some(true),
        ..Answers::default()
    };
    let measures = Measures {
        near_tandem_hold_s: seconds(10.0),
        five_times_sit_to_stand_s: seconds(11.9),
        alternate_step_s: seconds(9.9),
        ..Measures::default()
    };
    let known = Known { person: of_population(), answers, measures };
    assert_eq!(finding("quickscreen", &known).probability, Some([0.07, 0.07]));
    // The limits themselves: 10 s of near tandem are held, 12 s and 10 s are too long.
    let slow = Measures { five_times_sit_to_stand_s: seconds(12.0), alternate_step_s: seconds(10.0), ..measures };
    assert_eq!(finding("quickscreen", &Known { measures: slow, ..known }).probability, Some([0.13, 0.13]));
}

#[test]
fn quickscreen_gives_no_probability_to_users_of_walking_aids_or_while_nobody_knows() {
    for (uses_walking_aid, matches) in [(Some(true), Some(false)), (None, None)] {
        let person = Person { uses_walking_aid, ..of_population() };
        let found = finding("quickscreen", &Known { person, ..Known::default() });
        assert_eq!((found.probability, found.population_match), (None, matches));
        assert!(found.reason.contains("no probability"), "{}", found.reason);
    }
}

#[test]
fn quickscreen_leaves_a_test_open_that_is_nearer_to_its_limit_than_its_error() {
    let near = Measured { standard_error: Some(0.9), ..Measured::of(12.5) };
    let known = measured(Measures { five_times_sit_to_stand_s: Some(near), ..Measures::default() });
    assert_eq!(finding("quickscreen", &known).value, Some(0.0));
    assert_eq!(finding("sts5", &known).status, Some(Status::Indeterminate));
}

#[test]
fn sts5_tells_its_distance_to_the_limit_in_standard_errors() {
    let time = Measured { standard_error: Some(0.9), n_observations: Some(1), ..Measured::of(15.6) };
    let found = finding("sts5", &measured(Measures { five_times_sit_to_stand_s: Some(time), ..Measures::default() }));
    assert_eq!(found.status, Some(Status::Positive));
    assert!((found.distance_se.expect("a distance") - 4.0).abs() < 1e-9);
    assert!((found.ci95_high.expect("an interval") - 17.364).abs() < 1e-3);
    assert_eq!(found.evidence, Evidence::Unconfirmed);
}

#[test]
fn chair30_takes_its_limit_from_age_and_sex() {
    let rises = Measures { chair_stands_30_s: seconds(9.0), ..Measures::default() };
    let of = |age: f64, sex: Sex| {
        let person = Person { age_years: Some(age), sex: Some(sex), ..of_population() };
        finding("chair30", &Known { person, measures: rises, ..Known::default() }).status
    };
    assert_eq!(of(75.0, Sex::Female), Some(Status::Positive));
    assert_eq!(of(80.0, Sex::Female), Some(Status::Negative));
    assert_eq!(of(84.9, Sex::Male), Some(Status::Positive));
    assert_eq!(of(94.9, Sex::Female), Some(Status::Negative));
    assert_eq!(of(95.0, Sex::Female), Some(Status::NotAssessable));
    assert_eq!(of(59.0, Sex::Male), Some(Status::NotAssessable));
    let nobody = Known { measures: rises, ..Known::default() };
    assert_eq!(finding("chair30", &nobody).status, Some(Status::Unknown));
}

#[test]
fn tug_has_three_limits_of_three_authorities() {
    let of = |s: f64| {
        let known = measured(Measures { timed_up_and_go_s: seconds(s), ..Measures::default() });
        ["tug", "tug_modified", "tug_steadi"].map(|id| finding(id, &known).status == Some(Status::Positive))
    };
    assert_eq!(of(10.0), [false, false, false]);
    assert_eq!(of(12.0), [false, true, true]);
    assert_eq!(of(15.0), [false, true, true]);
    assert_eq!(of(15.1), [true, true, true]);
}

#[test]
fn sppb_gives_the_points_of_its_table() {
    let chair = |s: f64| {
        let known = measured(Measures { five_times_sit_to_stand_s: seconds(s), ..Measures::default() });
        finding("sppb_chair", &known).category.expect("points")
    };
    assert_eq!(
        [11.1, 11.2, 13.6, 13.7, 16.6, 16.7].map(chair),
        ["4", "3", "3", "2", "2", "1"].map(|p| format!("{p} of 4 points"))
    );
    let gait = |s: f64| {
        let known = measured(Measures { walk_4_m_s: seconds(s), ..Measures::default() });
        finding("sppb_gait4m", &known).category.expect("points")
    };
    assert_eq!(
        [4.81, 4.82, 6.20, 6.21, 8.70, 8.71].map(gait),
        ["4", "3", "3", "2", "2", "1"].map(|p| format!("{p} of 4 points"))
    );
    let balance = |side: f64, semi: Option<f64>, tandem: Option<f64>| {
        let known = measured(Measures {
            side_by_side_hold_s: seconds(side),
            semi_tandem_hold_s: semi.map(Measured::of),
            tandem_hold_s: tandem.map(Measured::of),
            ..Measures::default()
        });
        finding("sppb_balance", &known).category
    };
    let points = |n: u32| Some(format!("{n} of 4 points"));
    assert_eq!(balance(9.0, None, None), points(0));
    assert_eq!(balance(10.0, Some(9.0), None), points(1));
    assert_eq!(balance(10.0, Some(10.0), Some(2.0)), points(2));
    assert_eq!(balance(10.0, Some(10.0), Some(9.0)), points(3));
    assert_eq!(balance(10.0, Some(10.0), Some(10.0)), points(4));
    assert_eq!(balance(10.0, None, Some(10.0)), None);
}

#[test]
fn fes_i_and_ppa_have_bands_and_no_status() {
    let of = |falls_efficacy: u32, z: f64| {
        let answers =
            Answers { falls_efficacy: Some(falls_efficacy), physiological_profile_z: Some(z), ..Answers::default() };
        let known = Known { answers, ..Known::default() };
        let (fes, ppa) = (finding("fes_i", &known), finding("ppa", &known));
        assert_eq!((fes.status, ppa.status), (None, None));
        (fes.category.expect("a band"), ppa.category.expect("a band"))
    };
    let bands = |a: &str, b: &str| (a.to_owned(), b.to_owned());
    assert_eq!(of(19, 0.5), bands("low", "mild"));
    assert_eq!(of(20, 1.0), bands("moderate", "moderate"));
    assert_eq!(of(28, 2.0), bands("high", "high"));
    assert_eq!(of(64, 3.0), bands("high", "marked"));
}

#[test]
fn wfg2022_needs_the_questionnaire_and_follows_its_order() {
    let of = |answers: Answers, measures: Measures| {
        let found = finding("wfg2022", &Known { answers, measures, person: of_population() });
        (found.status.expect("a status"), found.category.unwrap_or_default())
    };
    let none = Measures::default();
    let slow = Measures { usual_speed_mps: seconds(0.8), ..none };
    let fast = Measures { usual_speed_mps: seconds(1.1), ..none };
    let fell = |n: u32| Answers {
        falls_12_months: Some(n),
        injury_needing_care: Some(false),
        is_frail: Some(false),
        lay_unable_to_rise: Some(false),
        loss_of_consciousness: Some(false),
        ..Answers::default()
    };
    let low = |status| (status, "low".to_owned());
    assert_eq!(of(Answers::default(), slow), (Status::NotAssessable, String::new()));
    assert_eq!(of(fell(2), fast), (Status::Positive, "high".to_owned()));
    assert_eq!(of(Answers { is_frail: Some(true), ..fell(1) }, none), (Status::Positive, "high".to_owned()));
    assert_eq!(of(fell(1), slow), (Status::Positive, "intermediate".to_owned()));
    assert_eq!(of(fell(1), fast), low(Status::Negative));
    assert_eq!(of(fell(1), none), (Status::Unknown, String::new()));
    assert_eq!(of(Answers { falls_12_months: Some(1), ..Answers::default() }, fast), (Status::Unknown, String::new()));
    let steady = Answers { feels_unsteady: Some(false), worries_about_falling: Some(false), ..fell(0) };
    assert_eq!(of(steady, slow), low(Status::Negative));
    assert_eq!(of(Answers { worries_about_falling: Some(true), ..steady }, slow).1, "intermediate");
    assert_eq!(of(fell(0), slow), (Status::Unknown, String::new()));
}

#[test]
fn a_variability_is_told_without_what_measurement_adds_or_not_at_all() {
    let width = |sd_m: f64, error_sd: Option<f64>, n: u32| {
        let sd = Measured { error_sd, n_observations: Some(n), ..Measured::of(sd_m) };
        finding("step_width_sd", &measured(Measures { step_width_sd_m: Some(sd), ..Measures::default() }))
    };
    // 2.0 and 1.0 cm make 2.24 cm.
    let found = width(0.022_360_7, Some(0.010), 40);
    assert!((found.value.expect("a value") - 0.020).abs() < 1e-6);
    assert_eq!(found.status, Some(Status::Negative));
    assert_eq!(width(0.030, Some(0.005), 40).status, Some(Status::Positive));
    for refused in [width(0.030, Some(0.013), 40), width(0.030, Some(0.005), 19), width(0.030, None, 40)] {
        assert_eq!(refused.status, Some(Status::NotAssessable), "{}", refused.reason);
    }
}

#[test]
fn step_width_cv_is_extreme_at_both_ends_and_only_in_people_who_walk_fast() {
    let of = |percent: f64, speed: f64| {
        let sd = Measured { error_sd: Some(0.0), n_observations: Some(40), ..Measured::of(0.1 * percent / 100.0) };
        let measures = Measures {
            step_width_m: Some(Measured::of(0.1)),
            step_width_sd_m: Some(sd),
            usual_speed_mps: Some(Measured::of(speed)),
            ..Measures::default()
        };
        finding("step_width_cv", &measured(measures)).status
    };
    assert_eq!(of(5.0, 1.1), Some(Status::Positive));
    assert_eq!(of(20.0, 1.1), Some(Status::Negative));
    assert_eq!(of(35.0, 1.1), Some(Status::Positive));
    assert_eq!(of(35.0, 0.9), Some(Status::NotAssessable));
}

#[test]
fn answers_that_contradict_each_other_are_named() {
    let answers = Answers {
        falls_12_months: Some(0),
        injury_needing_care: Some(true),
        falls_efficacy: Some(70),
        ..Answers::default()
    };
    let found = answers.contradictions();
    assert_eq!(found.len(), 2, "{found:?}");
    assert!(Answers::default().contradictions().is_empty());
}

#[test]
fn speed_norm_compares_with_the_mean_of_age_and_sex_and_has_no_status() {
    let known = |age: f64, speed: f64| {
        let person = Person { age_years: Some(age), sex: Some(Sex::Female), ..Person::default() };
        let measures = Measures { usual_speed_mps: Some(Measured::of(speed)), ..Measures::default() };
        Known { person, measures, ..Known::default() }
    };
    let of = |age, speed| gait_speed::SPEED_NORM.apply(&known(age, speed));
    assert_eq!(of(80.0, 0.843).reason, "-0.10 m/s against a mean of 0.94 m/s");
    assert_eq!((of(72.0, 1.2).status, of(72.0, 1.2).evidence), (None, Evidence::Unconfirmed));
    assert!(of(59.0, 1.2).reason.contains("60 to 99"));
}
