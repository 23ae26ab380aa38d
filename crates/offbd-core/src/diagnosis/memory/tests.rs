//! Published test vectors, and invariants.

use super::*;

const CODE: FaultCode = FaultCode::XServo;

struct Bench {
    memory: FaultMemory,
    rules: MemoryRules,
}

impl Bench {
    fn new(confirmation_threshold: u8, indicator: bool) -> Self {
        let rules =
            MemoryRules { confirmation_threshold, indicator, healing_cycles: 1, aging_cycles: 1 };
        Self { memory: FaultMemory::default(), rules }
    }

    fn byte(&self) -> String {
        self.memory.record(CODE).status.to_string()
    }

    fn failed(&mut self) -> String {
        self.memory.failed(CODE, &Suspicion::default(), &Evidence::default());
        self.memory.trip(CODE, &Suspicion::default(), &self.rules);
        self.byte()
    }

    fn passed(&mut self) -> String {
        self.memory.passed(CODE);
        self.byte()
    }

    fn start(&mut self) -> String {
        self.memory.start_cycle();
        self.byte()
    }

    fn end(&mut self) -> String {
        self.memory.end_cycle(&self.rules);
        self.byte()
    }
}

/// The published vectors for a confirmation threshold of 1, with and without the warning
/// indicator. Healing takes the first good cycle, aging the second, so that "cycle end"
/// and "healed" coincide here.
#[test]
fn validate_vectors_with_indicator() {
    let mut bench = Bench::new(1, true);
    bench.rules.healing_cycles = 2;
    assert_eq!(bench.byte(), "50");
    assert_eq!(bench.start(), "50");
    assert_eq!(bench.failed(), "AF");
    assert_eq!(bench.passed(), "AE");
    assert_eq!(bench.end(), "AE", "a cycle with a failure does not end pending");
    assert_eq!(bench.start(), "EC");
    assert_eq!(bench.passed(), "AC");
    assert_eq!(bench.end(), "A8");
    bench.start();
    bench.passed();
    assert_eq!(bench.end(), "28", "healed");
    bench.start();
    bench.passed();
    assert_eq!(bench.end(), "20", "aged");
}

#[test]
fn validate_vectors_without_indicator() {
    let mut bench = Bench::new(1, false);
    bench.start();
    assert_eq!(bench.failed(), "2F");
    assert_eq!(bench.passed(), "2E");
    bench.end();
    assert_eq!(bench.start(), "6C");
    assert_eq!(bench.passed(), "2C");
    assert_eq!(bench.end(), "28");
    bench.start();
    bench.passed();
    assert_eq!(bench.end(), "20", "aged");
}

#[test]
fn validate_vectors_with_threshold_two() {
    let mut bench = Bench::new(2, false);
    bench.start();
    assert_eq!(bench.failed(), "27");
    assert_eq!(bench.failed(), "27", "one cycle counts once");
    bench.end();
    bench.start();
    assert_eq!(bench.failed(), "2F");
}

#[test]
fn a_good_cycle_in_between_restarts_the_trip_counter() {
    let mut bench = Bench::new(2, false);
    bench.start();
    bench.failed();
    bench.end();
    bench.start();
    bench.passed();
    bench.end();
    bench.start();
    assert_eq!(bench.failed(), "27");
}

#[test]
fn a_cycle_without_a_result_neither_heals_nor_ends_pending() {
    let mut bench = Bench::new(1, true);
    bench.start();
    bench.failed();
    bench.passed();
    bench.end();
    bench.start();
    assert_eq!(bench.end(), "EC");
    assert_eq!(bench.memory.record(CODE).good_cycles, 0);
}

#[test]
fn clearing_and_acknowledging_are_different_acts() {
    let mut bench = Bench::new(1, true);
    assert!(!bench.memory.acknowledge(CODE), "nothing to acknowledge");
    bench.failed();
    assert!(bench.memory.acknowledge(CODE));
    assert_eq!(bench.byte(), "AF");
    bench.passed();
    bench.failed();
    assert!(!bench.memory.record(CODE).acknowledged, "a new occurrence asks again");
    bench.memory.clear(CODE);
    assert_eq!(bench.memory.record(CODE), &FaultRecord::default());
    assert_eq!(bench.byte(), "50");
}

/// A suspicion of `kind` with a weight; the rest is an offset.
fn weighed(kind: FaultKind, weight: f64) -> Suspicion {
    let each = |kind, weight| crate::diagnosis::Candidate { code: CODE, kind: Some(kind), weight };
    let candidates = vec![each(kind, weight), each(FaultKind::Offset, 1.0 - weight)];
    Suspicion { kind: Some(kind), candidates, ..Suspicion::default() }
}

#[test]
fn a_kind_is_told_only_of_a_confirmed_failure() {
    let mut bench = Bench::new(1, true);
    let unknown = Suspicion::default();
    let (dead, held) = (weighed(FaultKind::Dead, 0.9), weighed(FaultKind::Held, 0.7));
    assert!(!bench.memory.revise(CODE, &dead), "nothing has failed");
    bench.memory.failed(CODE, &unknown, &Evidence::default());
    assert!(!bench.memory.revise(CODE, &dead), "it is pending");
    bench.failed();
    bench.memory.trip(CODE, &unknown, &bench.rules);
    assert!(!bench.memory.revise(CODE, &unknown));
    assert!(bench.memory.revise(CODE, &dead));
    assert!(!bench.memory.revise(CODE, &dead), "it is known");
    assert!(!bench.memory.revise(CODE, &held), "what is sure stays");
    assert_eq!(bench.memory.record(CODE).kind(), Some(FaultKind::Dead));
    bench.passed();
    assert!(!bench.memory.revise(CODE, &weighed(FaultKind::Held, 0.9)), "it has passed");
}

#[test]
fn a_kind_is_revised_as_long_as_its_fault_lasts() {
    let mut bench = Bench::new(1, true);
    let (dead, held) = (FaultKind::Dead, FaultKind::Held);
    bench.memory.failed(CODE, &weighed(dead, 0.6), &Evidence::default());
    bench.memory.trip(CODE, &weighed(dead, 0.6), &bench.rules);
    assert!(!bench.memory.revise(CODE, &weighed(dead, 0.7)), "not sure");
    let present = bench.memory.record(CODE).suspicion.clone().unwrap();
    assert_eq!(present.kind_weight(), Some(0.7), "the weights are the present ones");
    assert!(!bench.memory.revise(CODE, &weighed(held, 0.7)), "another kind is not sure");
    assert_eq!(bench.memory.record(CODE).kind(), Some(dead));
    assert!(bench.memory.revise(CODE, &weighed(held, 0.8)), "it is sure now");
    assert!(!bench.memory.revise(CODE, &weighed(held, 0.95)), "told already");
    assert!(!bench.memory.revise(CODE, &weighed(dead, 0.75)), "what is sure stays");
    assert!(bench.memory.revise(CODE, &weighed(dead, 0.95)), "unless another kind is sure");
    assert_eq!(bench.memory.record(CODE).kind(), Some(dead));
}

/// What is wrong with the readings may change with each of them.
#[test]
fn the_kind_of_a_sensor_fault_stays() {
    let code = FaultCode::Sensor;
    let of = |kind| Suspicion { kind: Some(kind), ..Suspicion::default() };
    let (mut memory, noise) = (FaultMemory::default(), of(FaultKind::Noise));
    memory.failed(code, &noise, &Evidence::default());
    memory.trip(code, &noise, &MemoryRules::default());
    assert!(!memory.revise(code, &of(FaultKind::Spikes)));
    assert_eq!(memory.record(code).kind(), Some(FaultKind::Noise));
}

#[test]
fn occurrences_remember_the_first_and_the_last_onset() {
    let mut bench = Bench::new(1, false);
    let at = |t_s: f64| Suspicion { onset: SimTime::new(t_s), ..Suspicion::default() };
    for (t_s, passes) in [(3.0, true), (8.0, true), (12.0, false), (13.0, false)] {
        bench.memory.failed(CODE, &at(t_s), &Evidence::default());
        if passes {
            bench.passed();
        }
    }
    let record = bench.memory.record(CODE);
    assert_eq!((record.occurrences, record.failed_cycles), (3, 1));
    assert_eq!(record.first_onset, SimTime::new(3.0));
    assert_eq!(record.last_onset, SimTime::new(12.0), "it has not passed since");
    bench.end();
    bench.start();
    bench.memory.failed(CODE, &at(1.0), &Evidence::default());
    let record = bench.memory.record(CODE);
    assert_eq!((record.occurrences, record.failed_cycles), (3, 2), "still the same occurrence");
}

#[test]
fn healing_comes_before_aging_and_both_are_counted() {
    let mut bench = Bench::new(1, true);
    (bench.rules.healing_cycles, bench.rules.aging_cycles) = (2, 3);
    bench.failed();
    bench.end();
    let mut counted = Vec::new();
    for _ in 0..5 {
        bench.start();
        bench.passed();
        bench.end();
        let (record, rules) = (bench.memory.record(CODE), &bench.rules);
        counted.push((record.healing_counter(rules), record.aging_counter(rules)));
    }
    assert_eq!(counted, [(1, 0), (2, 0), (2, 1), (2, 2), (0, 0)], "then it is erased");
}

#[test]
fn what_changes_the_status_byte_is_told() {
    let mut bench = Bench::new(1, true);
    let (none, frame) = (Suspicion::default(), Evidence::default());
    let rules = bench.rules;
    assert_eq!([(); 2].map(|()| bench.memory.failed(CODE, &none, &frame)), [true, false]);
    assert_eq!([(); 2].map(|()| bench.memory.trip(CODE, &none, &rules)), [true, false]);
    assert_eq!([(); 2].map(|()| bench.memory.passed(CODE)), [true, false]);
}

#[test]
fn the_last_suspicion_counts() {
    let mut bench = Bench::new(1, false);
    let of = |kind| Suspicion { kind: Some(kind), ..Suspicion::default() };
    bench.memory.failed(CODE, &of(FaultKind::Dead), &Evidence::default());
    bench.memory.failed(CODE, &of(FaultKind::Held), &Evidence::default());
    assert_eq!(bench.memory.record(CODE).kind(), Some(FaultKind::Held));
    bench.memory.trip(CODE, &of(FaultKind::Dead), &bench.rules);
    assert_eq!(bench.memory.record(CODE).kind(), Some(FaultKind::Dead));
}

#[test]
fn a_failure_after_healing_begins_again_and_aging_erases_all() {
    let mut bench = Bench::new(1, true);
    bench.rules.aging_cycles = 2;
    let good_cycle = |bench: &mut Bench| {
        bench.start();
        bench.passed();
        bench.end();
    };
    bench.failed();
    bench.end();
    good_cycle(&mut bench);
    assert_eq!(bench.memory.record(CODE).word(), FaultStatus::Healed);
    bench.start();
    bench.failed();
    let record = bench.memory.record(CODE);
    assert_eq!((record.word(), record.good_cycles), (FaultStatus::Confirmed, 0));
    bench.end();
    (0..3).for_each(|_| good_cycle(&mut bench));
    let record = bench.memory.record(CODE);
    assert_eq!((record.occurrences, record.first_onset, record.good_cycles), (0, None, 0));
    assert_eq!((record.freeze_frame.is_none(), record.word()), (true, FaultStatus::Cleared));
}

#[test]
fn what_was_never_confirmed_does_not_heal() {
    let mut bench = Bench::new(2, true);
    bench.failed();
    bench.end();
    for _ in 0..2 {
        bench.start();
        bench.passed();
        bench.end();
    }
    let record = bench.memory.record(CODE);
    assert!(!record.healed && record.occurrences == 1);
    let counters = (record.healing_counter(&bench.rules), record.aging_counter(&bench.rules));
    assert_eq!(counters, (0, 0));
}

#[test]
fn a_pending_fault_and_a_confirmed_one_of_the_past_can_be_acknowledged() {
    let mut pending = Bench::new(2, false);
    assert!(!pending.memory.acknowledge(CODE) && !pending.memory.record(CODE).acknowledged);
    pending.failed();
    assert!(pending.memory.acknowledge(CODE) && pending.memory.record(CODE).acknowledged);
    let mut confirmed = Bench::new(1, false);
    confirmed.rules.healing_cycles = 5;
    confirmed.failed();
    for _ in 0..2 {
        confirmed.passed();
        confirmed.end();
        confirmed.start();
    }
    assert!(!confirmed.memory.record(CODE).status.pending());
    assert!(confirmed.memory.acknowledge(CODE) && confirmed.memory.record(CODE).acknowledged);
}

#[test]
fn just_enough_data_count_and_none_never_do() {
    let mut in_use = InUse::default();
    in_use.count(8.0, 0.0, 0.8);
    assert_eq!(in_use, InUse { cycles: 1, with_data: 1, judged: 0 });
    in_use.count(0.0, 0.0, 0.0);
    assert_eq!(in_use, InUse { cycles: 2, with_data: 1, judged: 0 });
}

/// SAE J1979: the ratio counts cycles and survives a clear by a scan tool.
#[test]
fn validate_the_in_use_ratio_outlives_a_clear() {
    let mut memory = FaultMemory::default();
    // Seconds of data and seconds judged, for a fault that takes 0.8 s.
    for (data_s, judged_s) in [(60.0, 30.0), (60.0, 0.5), (60.0, 0.0), (3.0, 0.5), (3.0, 0.8)] {
        memory.count_use(CODE, data_s, judged_s, 0.8);
    }
    let wanted = InUse { cycles: 5, with_data: 4, judged: 2 };
    assert_eq!(memory.record(CODE).in_use, wanted);
    assert_eq!(wanted.ratio(), Some(0.5));
    memory.clear(CODE);
    assert_eq!(memory.record(CODE).in_use, wanted);
    assert_eq!(InUse::default().ratio(), None);
}

mod properties {
    use super::*;
    use proptest::prelude::*;

    #[derive(Clone, Copy, Debug)]
    enum Event {
        Failed,
        Passed,
        Cycle { data_s: f64, judged_s: f64 },
        Clear,
    }

    fn event() -> impl Strategy<Value = Event> {
        prop_oneof![
            Just(Event::Failed),
            Just(Event::Passed),
            (0.0..100.0, 0.0..2.0).prop_map(|(data_s, judged_s)| Event::Cycle { data_s, judged_s }),
            Just(Event::Clear),
        ]
    }

    proptest! {
        /// For any sequence of events: counters stay within their limits, the ratio
        /// within 0 and 1, and a record without an occurrence has neither onset nor
        /// freeze frame.
        #[test]
        fn counters_agree(events in prop::collection::vec(event(), 0..200)) {
            let mut bench = Bench::new(1, true);
            (bench.rules.healing_cycles, bench.rules.aging_cycles) = (2, 3);
            let mut n_cycles = 0;
            for event in events {
                match event {
                    Event::Failed => drop(bench.failed()),
                    Event::Passed => drop(bench.passed()),
                    Event::Clear => bench.memory.clear(CODE),
                    Event::Cycle { data_s, judged_s } => {
                        n_cycles += 1;
                        bench.memory.count_use(CODE, data_s, judged_s, 0.8);
                        bench.end();
                        bench.start();
                    }
                }
                let (record, rules) = (bench.memory.record(CODE), &bench.rules);
                prop_assert_eq!(record.in_use.cycles, n_cycles);
                prop_assert!(record.in_use.judged <= record.in_use.with_data);
                prop_assert!(record.in_use.with_data <= record.in_use.cycles);
                prop_assert!(record.healing_counter(rules) <= rules.healing_cycles);
                prop_assert!(record.aging_counter(rules) < rules.aging_cycles);
                prop_assert_eq!(record.occurrences == 0, record.freeze_frame.is_none());
                prop_assert!(record.occurrences > 0 || record.failed_cycles == 0);
                if record.occurrences == 0 {
                    prop_assert_eq!(record.first_onset, None);
                }
            }
        }
    }
}
