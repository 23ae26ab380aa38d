//! Six decades of stiffness, damping, friction and slip threshold, and six of the step: a
//! run gives finite numbers or an error with the reason.

use super::scenes::{compliant, s1, s3, scene};
use offbd_core::plant::Contact;
use offbd_lab::scene::{
    Configuration, Failure, Laws, Method, Model, Pace, RunOutcome, Scene, choose, one_pass, run,
};
use proptest::prelude::*;

/// Ends and middle of six decades around the chapter's numbers, N/m.
const STIFFNESS: [f64; 3] = [1e3, 1e6, 1e9];
const DAMPING: [f64; 3] = [1.0, 1e3, 1e6];
const FRICTION: [f64; 3] = [1e-4, 0.1, 100.0];
const THRESHOLD: [f64; 3] = [1e-7, 1e-4, 0.1];

fn grid() -> impl Iterator<Item = Contact> {
    (0..81_usize).map(|i| {
        let digit = |power: u32| i / 3_usize.pow(power) % 3;
        let (k, d) = (STIFFNESS[digit(0)], DAMPING[digit(1)]);
        Contact::new(k, d, FRICTION[digit(2)], THRESHOLD[digit(3)]).unwrap()
    })
}

fn laws() -> [Laws; 2] {
    [s1(), s3()]
}

/// Runs a scene; returns an error unless all numbers at its end are finite.
fn ends(scene: &Scene, laws: &Laws, configuration: &Configuration) -> Result<(), String> {
    match run(scene, &mut laws.clone(), configuration, None) {
        Ok(outcome) if outcome.end.to_row().iter().all(|value| value.is_finite()) => Ok(()),
        Ok(outcome) => Err(format!("{:?}", outcome.end)),
        Err(failure) => Err(failure.to_string()),
    }
}

/// Returns whether a run gave finite numbers, or the error that they are not.
fn is_finite_or_reported(found: &Result<RunOutcome, Failure>) -> bool {
    match found {
        Ok(outcome) => outcome.end.to_row().iter().all(|value| value.is_finite()),
        Err(failure) => matches!(failure, Failure::NotFinite { .. }),
    }
}

fn sliding() -> Configuration {
    Configuration::new(Model::Sliding, Method::Dopri5, Pace::Tolerance(1e-6)).unwrap()
}

#[test]
fn the_contact_step_and_the_rigid_plate_take_any_contact() {
    for contact in grid() {
        let scene = scene(contact, 0.2);
        for laws in &laws() {
            let step = compliant(Method::ContactStep, Pace::Step(1e-3));
            assert_eq!(ends(&scene, laws, &step), Ok(()), "{contact:?}");
            assert_eq!(ends(&scene, laws, &sliding()), Ok(()), "sliding on {contact:?}");
        }
    }
}

/// Every fifth contact of the grid, which includes every value of every parameter: a
/// spring of 1e9 N/m with little damping oscillates at 22 kHz.
#[test]
fn rosenbrock_methods_take_any_contact_by_tolerance() {
    for contact in grid().step_by(5) {
        let scene = scene(contact, 0.05);
        for laws in &laws() {
            for method in [Method::Rodas3, Method::Rodas4] {
                let found = ends(&scene, laws, &compliant(method, Pace::Tolerance(1e-3)));
                assert_eq!(found, Ok(()), "{method} on {contact:?}");
            }
        }
    }
}

/// Either a choice whose configuration runs, or an error that no candidate is accurate
/// enough.
#[test]
fn a_choice_or_a_reason_on_any_contact() {
    let (mut chosen, mut refused) = (0, 0);
    for contact in grid() {
        let scene = scene(contact, 0.2);
        for laws in &laws() {
            match choose(&scene, laws, 1e-3) {
                Ok(choice) => {
                    chosen += 1;
                    assert_eq!(ends(&scene, laws, &choice.configuration), Ok(()), "{contact:?}");
                    assert!(choice.error_m <= 1e-3, "{contact:?}: {}", choice.error_m);
                }
                Err(out) => {
                    refused += 1;
                    assert!(!out.tried.is_empty(), "{contact:?}");
                }
            }
        }
    }
    println!("chosen {chosen}, refused {refused}");
    assert!(chosen > 100, "{chosen} chosen, {refused} refused");
}

#[test]
fn one_pass_ends_in_a_number_on_any_contact() {
    for contact in grid() {
        let scene = scene(contact, 0.05);
        for laws in &laws() {
            let run = one_pass(&scene, &mut laws.clone(), 1e-3, None).unwrap();
            assert!(run.end.to_row().iter().all(|value| value.is_finite()), "{contact:?}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn what_lies_between_ends_in_a_number_or_says_why_not(
        k in 3.0..9.0_f64, d in 0.0..6.0_f64, mu in -4.0..2.0_f64, threshold in -7.0..-1.0_f64,
        h in -5.0..-1.0_f64,
    ) {
        let [k, d, mu, threshold, h] = [k, d, mu, threshold, h].map(|power| 10_f64.powf(power));
        let scene = scene(Contact::new(k, d, mu, threshold).unwrap(), 0.05);
        for laws in &laws() {
            let contact_step = compliant(Method::ContactStep, Pace::Step(h));
            prop_assert_eq!(ends(&scene, laws, &contact_step), Ok(()));
            for method in [Method::Rodas3, Method::Rodas4] {
                let configuration = compliant(method, Pace::Step(h));
                let found = run(&scene, &mut laws.clone(), &configuration, None);
                prop_assert!(is_finite_or_reported(&found), "{:?}", found);
            }
        }
    }
}

/// Steps from a microsecond to longer than the plate's motion.
#[test]
fn every_step_of_six_decades_ends_in_a_number_or_says_why_not() {
    let scene = scene(Contact::CHAPTER, 0.1);
    for h in [1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.1] {
        for laws in &laws() {
            for &method in Model::Compliant.methods() {
                let configuration = compliant(method, Pace::Step(h));
                let found = run(&scene, &mut laws.clone(), &configuration, None);
                assert!(is_finite_or_reported(&found), "{method} at {h} s: {found:?}");
                let sure = method == Method::ContactStep || h <= 1e-6;
                assert!(!sure || found.is_ok(), "{method} at {h} s: {found:?}");
            }
        }
    }
}

/// The planar model is for balls: for a block the error states that, and not that a number
/// is not finite, which would blame the step.
#[test]
fn a_planar_run_of_a_block_is_an_error_that_names_the_block() {
    let mut scene = scene(Contact::CHAPTER, 0.4);
    scene.subject = Scene::block(0.02, 0.1, &scene.plate).unwrap();
    for &method in Model::Planar.methods() {
        let configuration = Configuration::new(Model::Planar, method, Pace::Step(1e-3)).unwrap();
        let failure = run(&scene, &mut s1(), &configuration, None).unwrap_err();
        assert_eq!(failure.to_string(), "a block does not roll at 0.000000 s", "{method}");
    }
}
