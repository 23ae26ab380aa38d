//! Invalid steps, tolerances, durations and sampling intervals.

use super::scenes::{compliant, s1, sampled, scene};
use offbd_core::plant::{Ball, Contact, Plate};
use offbd_core::vocabulary::Invalid;
use offbd_lab::scene::{
    Configuration, LONGEST_SCENE_S, LONGEST_STEP_S, Method, Model, Pace, SHORTEST_STEP_S, Scene,
    Subject,
};
use proptest::prelude::*;

const NONSENSE: [f64; 7] =
    [0.0, -0.0, -1e-3, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, f64::MIN_POSITIVE];

fn element<T>(result: Result<T, Invalid>) -> String {
    result.map_or_else(|invalid| invalid.element, |_| String::new())
}

#[test]
fn a_pace_that_is_none_is_named() {
    for bad in NONSENSE.into_iter().chain([LONGEST_STEP_S * 1.001, SHORTEST_STEP_S * 0.999, 1e300])
    {
        for model in Model::ALL {
            for &method in model.methods() {
                let step = element(Configuration::new(model, method, Pace::Step(bad)));
                assert_eq!(step, "/step", "{model} {method} {bad}");
                if !(1e-12..=1.0).contains(&bad) {
                    let tolerance =
                        element(Configuration::new(model, method, Pace::Tolerance(bad)));
                    assert_eq!(tolerance, "/tolerance", "{model} {method} {bad}");
                }
            }
        }
    }
}

#[test]
fn the_ends_of_the_range_are_within_it() {
    for pace in [SHORTEST_STEP_S, LONGEST_STEP_S].map(Pace::Step) {
        assert!(Configuration::new(Model::Compliant, Method::ContactStep, pace).is_ok());
    }
    for pace in [1e-12, 1.0].map(Pace::Tolerance) {
        assert!(Configuration::new(Model::Compliant, Method::Rodas4, pace).is_ok());
    }
}

#[test]
fn a_scene_of_no_length_is_named() {
    let of = |duration_s| {
        let subject = Subject::Ball(Ball::default());
        Scene::new(subject, Plate::default(), Contact::CHAPTER, duration_s)
    };
    let long = [LONGEST_SCENE_S * 1.001, 1e300];
    for bad in NONSENSE.into_iter().filter(|&d| d != f64::MIN_POSITIVE).chain(long) {
        assert_eq!(element(of(bad)), "/duration_s", "{bad}");
    }
    // The shortest possible scene runs.
    let tiny = of(f64::MIN_POSITIVE).unwrap();
    let (outcome, samples) =
        sampled(&tiny, &s1(), &compliant(Method::ContactStep, Pace::Step(1e-3)), 1.0).unwrap();
    assert_eq!((outcome.statistics.steps, samples.len()), (1, 1));
}

/// An invalid interval gives a sample of the start only; sampling never hangs.
#[test]
fn samples_at_no_interval_are_the_start_alone() {
    let scene = scene(Contact::CHAPTER, 0.01);
    for bad in NONSENSE {
        let configuration = compliant(Method::ContactStep, Pace::Step(1e-3));
        let (_, samples) = sampled(&scene, &s1(), &configuration, bad).unwrap();
        assert_eq!(samples.len(), 1, "every {bad} s");
        assert_eq!(samples[0].0, 0.0);
    }
}

/// A step longer than the scene is shortened to it.
#[test]
fn a_step_longer_than_the_scene_is_one_step() {
    let scene = scene(Contact::CHAPTER, 0.05);
    let configuration = compliant(Method::ContactStep, Pace::Step(10.0));
    let (outcome, _) = sampled(&scene, &s1(), &configuration, 0.05).unwrap();
    assert_eq!(outcome.statistics.steps, 1);
}

proptest! {
    #[test]
    fn any_bits_are_a_pace_or_an_error(bits in any::<u64>()) {
        let value = f64::from_bits(bits);
        for model in Model::ALL {
            for &method in model.methods() {
                for (name, pace) in [("/step", Pace::Step(value)), ("/tolerance", Pace::Tolerance(value))] {
                    if let Err(invalid) = Configuration::new(model, method, pace) {
                        prop_assert_eq!(invalid.element, name);
                    }
                }
            }
        }
    }
}
