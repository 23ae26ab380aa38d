//! An engine that goes on from a snapshot does exactly what the original would do.

use crate::support::{learnt, rig};
use offbd::wire::judging::Judging;
use offbd_core::diagnosis::{FaultMemory, Profile};
use offbd_core::engine::{Input, Rig, SNAPSHOT_FORMAT, Setup, UsableMotion};
use offbd_core::vocabulary::{FaultCode, Sample};
use proptest::prelude::*;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};

fn bytes(state: &impl Serialize) -> Vec<u8> {
    rmp_serde::to_vec(state).unwrap()
}

/// Returns a copy by way of the serialised form.
fn copy<T: Serialize + DeserializeOwned>(state: &T) -> T {
    rmp_serde::from_slice(&bytes(state)).unwrap()
}

/// A disturbance of a recording at the row with this number.
#[derive(Clone, Debug)]
enum Disturbance {
    Missing(usize),
    NoPosition(usize),
    ClockStep(usize, f64),
    Swapped(usize),
    Twice(usize),
    Spike(usize),
    Act(usize, bool),
}

fn disturbance(n: usize) -> impl Strategy<Value = Disturbance> {
    use Disturbance as D;
    prop_oneof![
        (0..n).prop_map(D::Missing),
        (0..n).prop_map(D::NoPosition),
        (0..n, -30.0..30.0).prop_map(|(i, s)| D::ClockStep(i, s)),
        (1..n).prop_map(D::Swapped),
        (0..n).prop_map(D::Twice),
        (0..n).prop_map(D::Spike),
        (0..n, any::<bool>()).prop_map(|(i, clears)| D::Act(i, clears)),
    ]
}

/// Returns the inputs of a session whose x servo dies half-way, with `disturbances`.
fn inputs(n: usize, numbered: bool, disturbances: &[Disturbance]) -> Vec<Input> {
    let mut samples = rig(n, n / 2);
    if !numbered {
        samples.iter_mut().for_each(|sample| sample.seq = None);
    }
    let mut inputs: Vec<Input> = samples.into_iter().map(Input::Sample).collect();
    let change = |input: &mut Input, change: &dyn Fn(&mut Sample)| {
        if let Input::Sample(sample) = input {
            change(sample);
        }
    };
    for disturbance in disturbances {
        match *disturbance {
            Disturbance::Missing(i) => drop(inputs.remove(i.min(inputs.len() - 1))),
            Disturbance::NoPosition(i) => {
                let to = (i + 150).min(n - n / 10);
                for input in inputs.iter_mut().take(to).skip(i) {
                    change(input, &|s| (s.x_m, s.y_m) = (None, None));
                }
            }
            Disturbance::ClockStep(i, by_s) => {
                for input in inputs.iter_mut().skip(i) {
                    change(input, &|s| s.t_s += by_s);
                }
            }
            Disturbance::Swapped(i) => {
                let i = i.min(inputs.len() - 1);
                inputs.swap(i - 1, i);
            }
            Disturbance::Twice(i) => inputs.insert(i, inputs[i.min(inputs.len() - 1)]),
            Disturbance::Spike(i) => {
                let i = i.min(inputs.len() - 1);
                change(&mut inputs[i], &|s| s.x_m = Some(0.1));
            }
            Disturbance::Act(i, clears) => {
                let i = i.min(inputs.len());
                let (clear, acknowledge) = (Input::Clear, Input::Acknowledge);
                inputs.insert(i, (if clears { clear } else { acknowledge })(FaultCode::XServo));
            }
        }
    }
    inputs
}

fn setups() -> Vec<Setup> {
    vec![
        Setup::new(learnt("a"), None).unwrap(),
        Setup::new(learnt("a"), Some(Profile::Textbook)).unwrap(),
        Setup::new(Rig::chapter("a"), None).unwrap(),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    #[test]
    fn a_restored_engine_goes_on_as_the_original(
        setup in prop::sample::select(setups()),
        numbered: bool,
        disturbances in prop::collection::vec(disturbance(1500), 0..6),
        cut in 0..1500_usize,
    ) {
        let inputs = inputs(1500, numbered, &disturbances);
        let mut motion = UsableMotion::new(&setup.rig);
        let mut original = Judging::new(setup, FaultMemory::default());
        let (before, after) = inputs.split_at(cut.min(inputs.len()));
        for input in before {
            original.input(*input);
            if let Input::Sample(sample) = input {
                motion.take(sample);
            }
        }
        let (mut restored, mut restored_motion) = (copy(&original), copy(&motion));
        for input in after.iter().chain([&Input::End]) {
            let unjudged = original.engine().unjudged();
            prop_assert_eq!(original.input(*input), restored.input(*input));
            prop_assert_eq!(original.transitions(), restored.transitions());
            if unjudged.is_none() {
                prop_assert_eq!(original.engine().evidence(), restored.engine().evidence());
            }
            if let Input::Sample(sample) = input {
                motion.take(sample);
                restored_motion.take(sample);
            }
        }
        let (a, b) = (original.summary("s", 0), restored.summary("s", 0));
        prop_assert_eq!(serde_json::to_value(a).unwrap(), serde_json::to_value(b).unwrap());
        prop_assert_eq!(bytes(&original), bytes(&restored));
        prop_assert_eq!(bytes(&motion), bytes(&restored_motion));
    }
}

/// Adds the types that occur in `value` to the paths of its fields.
fn add_fields(path: &str, value: &Value, fields: &mut BTreeMap<String, BTreeSet<&str>>) {
    let word = match value {
        Value::Object(entries) => {
            let is_map = entries.keys().all(|key| key.parse::<u32>().is_ok());
            for (key, value) in entries {
                let key = if is_map { "*" } else { key };
                add_fields(&format!("{path}.{key}"), value, fields);
            }
            return;
        }
        Value::Array(items) => {
            items.iter().for_each(|item| add_fields(&format!("{path}[]"), item, fields));
            return;
        }
        Value::Null => "none",
        Value::Bool(_) => "bool",
        Value::Number(number) if number.is_f64() => "float",
        Value::Number(_) => "integer",
        Value::String(_) => "word",
    };
    fields.entry(path.to_owned()).or_default().insert(word);
}

/// The fields of a snapshot. If they change, raise `SNAPSHOT_FORMAT`: otherwise a new version
/// reads the snapshots of an old one wrongly.
#[test]
fn the_fields_of_a_snapshot_change_only_with_its_version() {
    let mut fields = BTreeMap::new();
    for setup in setups() {
        let mut motion = UsableMotion::new(&setup.rig);
        let mut judging = Judging::new(setup, FaultMemory::default());
        let disturbances = [Disturbance::Spike(900), Disturbance::ClockStep(1200, -4.0)];
        for (i, input) in inputs(1500, fields.is_empty(), &disturbances).into_iter().enumerate() {
            judging.input(input);
            if let Input::Sample(sample) = input {
                motion.take(&sample);
            }
            if i % 10 == 0 {
                add_fields("judging", &serde_json::to_value(&judging).unwrap(), &mut fields);
                add_fields("motion", &serde_json::to_value(&motion).unwrap(), &mut fields);
            }
        }
    }
    let lines = fields.iter().map(|(path, words)| {
        format!("{path}: {}", Vec::from_iter(words.iter().copied()).join(" | "))
    });
    let text = format!("format {SNAPSHOT_FORMAT}\n{}", Vec::from_iter(lines).join("\n"));
    insta::assert_snapshot!(text);
}
