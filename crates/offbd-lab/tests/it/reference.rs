//! Models and methods against independently computed trajectories:
//! `crates/offbd-lab/tests/reference/make.py` computes them.

use std::f64::consts::PI;

use nalgebra::{Vector2, Vector3};
use offbd_core::plant::{Ball, Contact, Motion, Plate};
use offbd_lab::scene::{
    Configuration, Law, Laws, Method, Model, OnePass, Pace, Push, Samples, Scene, Subject, Term,
    choose, one_pass, run,
};

/// Times and positions, x and y; without a column y, the motion is along x only.
type Track = Vec<(f64, Vector2<f64>)>;

fn track(name: &str) -> Track {
    let path = format!("{}/tests/reference/{name}.csv", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{path}: {error}"));
    let row = |line: &str| -> (f64, Vector2<f64>) {
        let n: Vec<f64> = line.split(',').map(|n| n.parse().unwrap()).collect();
        (n[0], Vector2::new(n[1], n.get(2).copied().unwrap_or(0.0)))
    };
    text.lines().skip(1).map(row).collect()
}

/// Returns one of the charted scenes with its drive.
fn scene(name: &str) -> (Scene, Laws) {
    let (law, contact) = match name.strip_suffix("-soft") {
        Some(law) => (law, Contact::SOFT),
        None => (name, Contact::CHAPTER),
    };
    let sine = |frequency, phase| Term::Sine { amplitude: 0.05, frequency, phase };
    let (qx, qy, duration) = match law {
        "slope" => (Term::Constant(PI / 20.0), Term::Constant(PI / 20.0), 0.4),
        "sine" => (sine(0.7, 0.0), sine(0.9, 0.5), 10.0),
        _ => {
            let steep = Term::Smoothstep { to: 1.2, start: 0.0, duration: 0.15 };
            (Term::Constant(0.0), steep, 0.4)
        }
    };
    let laws = Laws::new(Law::new(&[qx]), Law::new(&[qy]), Vec::new());
    (on_the_chapters_plate(contact, duration), laws)
}

fn on_the_chapters_plate(contact: Contact, duration: f64) -> Scene {
    Scene::new(Subject::Ball(Ball::default()), Plate::default(), contact, duration).unwrap()
}

const SCENES: [&str; 6] = ["slope", "sine", "steep", "slope-soft", "sine-soft", "steep-soft"];

/// Returns the positions every `every` seconds.
fn positions(
    (scene, laws): &(Scene, Laws),
    configuration: &Configuration,
    every: f64,
) -> Vec<Vector2<f64>> {
    let mut path = Vec::new();
    let mut sink = |_: f64, at: &Motion| path.push(at.position.xy());
    let mut samples = Samples::new(every, &mut sink);
    run(scene, &mut laws.clone(), configuration, Some(&mut samples)).unwrap();
    path
}

fn apart(a: &[Vector2<f64>], b: &[Vector2<f64>]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(p, q)| (p - q).norm()).fold(0.0, f64::max)
}

/// Returns the largest distance from `truth`, m.
fn error(scene: &(Scene, Laws), configuration: &Configuration, truth: &Track) -> f64 {
    let path = positions(scene, configuration, truth[1].0);
    assert_eq!(path.len(), truth.len());
    path.iter().zip(truth).map(|(p, (_, q))| (p - q).norm()).fold(0.0, f64::max)
}

fn configuration(model: Model, method: Method, pace: Pace) -> Configuration {
    Configuration::new(model, method, pace).unwrap()
}

#[test]
fn validate_rolling_on_every_scene() {
    for name in ["slope", "sine", "steep"] {
        let (scene, truth) = (scene(name), track(&format!("rolling-{name}")));
        for (method, pace) in
            [(Method::Rk4, Pace::Step(1e-3)), (Method::Dopri5, Pace::Tolerance(1e-8))]
        {
            let off = error(&scene, &configuration(Model::Rolling, method, pace), &truth);
            assert!(off < 1e-9, "{name} by {method}: {off:e} m");
        }
    }
}

#[test]
fn validate_compliant_on_every_scene() {
    for name in SCENES {
        let (scene, truth) = (scene(name), track(&format!("compliant-{name}")));
        for (method, tolerance) in [(Method::Rodas4, 1e-7), (Method::Rodas3, 1e-6)] {
            let pace = Pace::Tolerance(tolerance);
            let off = error(&scene, &configuration(Model::Compliant, method, pace), &truth);
            assert!(off < 1e-7, "{name} by {method}: {off:e} m");
        }
    }
}

/// The contact step at 1 ms, beyond the stability limit of any explicit method: its error
/// is 1.5e-6 m on the sine, and about 1e-4 m through slip, flight and landing.
#[test]
fn validate_the_contact_step_at_a_millisecond() {
    for (name, most) in [("slope", 1e-8), ("sine", 1e-5), ("steep", 1e-4), ("steep-soft", 2e-4)] {
        let contact = configuration(Model::Compliant, Method::ContactStep, Pace::Step(1e-3));
        let off = error(&scene(name), &contact, &track(&format!("compliant-{name}")));
        assert!(off < most, "{name}: {off:e} m");
    }
}

/// The rigid plate with Coulomb friction: agrees with its own reference to rounding, and
/// with the compliant one within the error of rigidity.
#[test]
fn validate_sliding_through_slip_flight_and_landing() {
    let rigid = configuration(Model::Sliding, Method::Dopri5, Pace::Tolerance(1e-9));
    let off = error(&scene("steep"), &rigid, &track("coulomb-steep"));
    assert!(off < 1e-9, "against the rigid plate: {off:e} m");
    let off = error(&scene("steep"), &rigid, &track("compliant-steep"));
    assert!(off < 1e-4, "against the compliant plate: {off:e} m");
}

/// Creep and sag to first order reduce the errors of the rolling ball, 1.2e-6 and 3e-6 m,
/// to terms of second order.
#[test]
fn validate_creeping_against_the_compliant_model() {
    let creeping = configuration(Model::Creeping, Method::Dopri5, Pace::Tolerance(1e-6));
    let rolling = configuration(Model::Rolling, Method::Dopri5, Pace::Tolerance(1e-6));
    for (name, most) in [("slope", 1e-9), ("sine", 1e-7)] {
        let (scene, truth) = (scene(name), track(&format!("compliant-{name}")));
        let off = error(&scene, &creeping, &truth);
        assert!(off < most, "{name}: {off:e} m");
        let rolled = error(&scene, &rolling, &truth);
        assert!(rolled > 20.0 * off, "{name}: rolling {rolled:e} m, creeping {off:e} m");
    }
}

/// On a plate with large swings about both axes, and thus a rotation about its normal,
/// creep and sag affect every term of the motion; the remaining error is proportional to
/// their square.
#[test]
fn validate_creeping_on_a_plate_that_turns_about_its_normal() {
    let sine = |frequency, phase| Law::new(&[Term::Sine { amplitude: 0.3, frequency, phase }]);
    let laws = Laws::new(sine(1.1, 0.9), sine(0.8, 1.6), Vec::new());
    let off = [1.0, 0.5].map(|part| {
        let contact = Contact::new(8e5 / part, 1000.0, 0.6, 1e-4 * part).unwrap();
        let scene = (on_the_chapters_plate(contact, 1.0), laws.clone());
        let run = |model, method, tolerance| {
            positions(&scene, &configuration(model, method, Pace::Tolerance(tolerance)), 0.01)
        };
        let truth = run(Model::Compliant, Method::Rodas4, 1e-10);
        apart(&run(Model::Creeping, Method::Dopri5, 1e-9), &truth)
    });
    assert!(off[0] < 1e-7 && off[1] < off[0] / 3.5, "{off:?}");
}

#[test]
fn validate_the_choice_on_every_scene() {
    for name in SCENES {
        let (scene, truth) = (scene(name), track(&format!("compliant-{name}")));
        for tolerance in [1e-2, 1e-3, 1e-4, 1e-5, 1e-6] {
            let choice = choose(&scene.0, &scene.1, tolerance).unwrap();
            let off = error(&scene, &choice.configuration, &truth);
            let chosen = choice.configuration;
            assert!(off <= tolerance, "{name} at {tolerance:e} m: {chosen:?} is off by {off:e} m");
        }
    }
}

/// For a plate that hardly moves the planar model is chosen, and its error bound holds
/// against the compliant model.
#[test]
fn validate_the_choice_on_a_gentle_plate() {
    let sine = |amplitude, frequency| Term::Sine { amplitude, frequency, phase: 1.0 };
    for (amplitude, frequency) in [(0.003, 0.2), (0.01, 0.5), (0.002, 1.0), (0.001, 10.0)] {
        let law = Law::new(&[sine(amplitude, frequency)]);
        let laws = Laws::new(law.clone(), law, Vec::new());
        let scene = (on_the_chapters_plate(Contact::CHAPTER, 1.0), laws);
        let chosen = choose(&scene.0, &scene.1, 1e-3).unwrap().configuration;
        assert_eq!(chosen.model(), Model::Planar, "{amplitude} rad, {frequency} Hz");
        let tight = configuration(Model::Compliant, Method::Rodas4, Pace::Tolerance(1e-9));
        let truth = positions(&scene, &tight, 0.01);
        let off = apart(&positions(&scene, &chosen, 0.01), &truth);
        assert!(off <= 1e-3, "{amplitude} rad, {frequency} Hz: {off:e} m");
    }
}

/// Returns the positions of a run in one pass at regular times, and the run.
fn in_one_pass(
    (scene, laws): &(Scene, Laws),
    tolerance_m: f64,
    every: f64,
) -> (Vec<Vector2<f64>>, OnePass) {
    let mut path = Vec::new();
    let mut sink = |_: f64, at: &Motion| path.push(at.position.xy());
    let mut samples = Samples::new(every, &mut sink);
    let run = one_pass(scene, &mut laws.clone(), tolerance_m, Some(&mut samples)).unwrap();
    (path, run)
}

/// Asserts that one pass keeps the tolerances, compared with RODAS at 1e-10 m.
fn keeps(scene: &(Scene, Laws), tolerances: &[f64], every: f64) {
    let tight = configuration(Model::Compliant, Method::Rodas4, Pace::Tolerance(1e-10));
    let truth = positions(scene, &tight, every);
    for &tolerance in tolerances {
        let (path, run) = in_one_pass(scene, tolerance, every);
        let off = apart(&path, &truth);
        assert!(off <= tolerance, "{run:?} is off by {off:e} m at {tolerance:e}, {scene:?}");
    }
}

#[test]
fn validate_one_pass_on_every_scene() {
    for name in SCENES {
        let (scene, truth) = (scene(name), track(&format!("compliant-{name}")));
        let positions: Vec<_> = truth.iter().map(|(_, at)| *at).collect();
        for tolerance in [1e-2, 1e-3, 1e-4, 1e-5, 1e-6] {
            let (path, run) = in_one_pass(&scene, tolerance, truth[1].0);
            let off = apart(&path, &positions);
            assert!(off <= tolerance, "{name} at {tolerance:e} m is off by {off:e} m: {run:?}");
            let on_the_plate = run.most_accurate().0 != "compliant";
            assert!(
                !on_the_plate || run.error_m <= tolerance,
                "{name} at {tolerance:e} m: {run:?}"
            );
            let unsampled = one_pass(&scene.0, &mut scene.1.clone(), tolerance, None).unwrap();
            assert_eq!(unsampled, run, "{name}: samples change the run");
        }
    }
}

/// A ball that rolls is never handed to the contact model, except for the finest tolerance.
#[test]
fn one_pass_uses_no_more_model_than_a_scene_needs() {
    let last = |name: &str, tolerance| {
        let (scene, laws) = scene(name);
        one_pass(&scene, &mut laws.clone(), tolerance, None).unwrap().most_accurate().0
    };
    assert_eq!(["slope", "sine"].map(|name| last(name, 1e-2)), ["rolling"; 2]);
    assert_eq!(["sine", "sine-soft"].map(|name| last(name, 1e-6)), ["creeping", "sagging"]);
    assert_eq!([1e-2, 1e-4, 1e-6].map(|t| last("steep", t)), ["sliding", "sliding", "compliant"]);
    assert_eq!(last("steep-soft", 1e-3), "compliant");
}

/// Windows end at the plate's edge: the ball falls where the contact model says.
#[test]
fn validate_one_pass_over_the_edge_and_after_a_push() {
    let mut tilted = on_the_chapters_plate(Contact::CHAPTER, 0.8);
    tilted.edges = true;
    let tilt = Law::new(&[Term::Constant(0.2)]);
    let falls = (tilted, Laws::new(tilt, Law::default(), Vec::new()));
    let push = Push { force: Vector2::new(0.02, -0.05), start_s: 0.3, duration_s: 0.1 };
    let swing = Law::new(&[Term::Sine { amplitude: 0.03, frequency: 0.8, phase: 0.2 }]);
    let pushed = on_the_chapters_plate(Contact::CHAPTER, 1.0);
    let pushed = (pushed, Laws::new(swing.clone(), swing, vec![push]));
    for scene in [falls, pushed] {
        keeps(&scene, &[1e-3, 1e-5], 0.01);
    }
}

/// A plate whose acceleration jumps throws a ball that rolls, and one that slips: the damper
/// holds it until its depth is gone.
#[test]
fn validate_one_pass_where_the_plate_throws_the_ball() {
    let step = |to, start, duration| Term::Smoothstep { to, start, duration };
    let rolls = Law::new(&[Term::Constant(-0.264), step(-1.275, 0.317, 0.249)]);
    let slips = [step(1.033, 0.062, 0.505), step(1.137, 0.442, 0.269)];
    for (friction, laws) in [
        (0.8, Laws::new(rolls, Law::default(), Vec::new())),
        (0.35, Laws::new(Law::new(&[step(0.661, 0.434, 0.129)]), Law::new(&slips), Vec::new())),
    ] {
        let contact = Contact::new(8e5, 1000.0, friction, 1e-4).unwrap();
        keeps(&(on_the_chapters_plate(contact, 1.0), laws), &[1e-2, 1e-3, 1e-4], 0.01);
    }
}

/// Balls and blocks that fall onto a hard plate, slip and spin, at several frictions.
#[test]
fn validate_one_pass_on_bodies_that_start_slipping_or_above_the_plate() {
    let mut dice = Dice(0x9E37_79B9_7F4A_7C15);
    let (mut slid, number) = (0, 40);
    for i in 0..number {
        let contact = Contact::new(8e5, 1000.0, dice.between(0.05, 1.0), 1e-4).unwrap();
        let mut scene = on_the_chapters_plate(contact, 0.4);
        if i % 4 == 0 {
            scene.subject = Scene::block(0.02, 0.1, &scene.plate).unwrap();
            scene.initial = Motion::at_rest(&scene.body());
        }
        let height = if i % 2 == 0 { 0.0 } else { dice.between(1e-4, 0.01) };
        let start = &mut scene.initial;
        start.position.z += height;
        start.velocity = Vector3::new(dice.between(-0.5, 0.5), dice.between(-0.5, 0.5), 0.0);
        start.spin = Vector3::new(dice.between(-20.0, 20.0), dice.between(-20.0, 20.0), 1.0);
        let laws = Laws::new(dice.law(), dice.law(), Vec::new());
        let scene = (scene, laws);
        keeps(&scene, &[1e-2, 1e-3, 1e-4, 1e-5], 0.004);
        let coarse = one_pass(&scene.0, &mut scene.1.clone(), 1e-2, None).unwrap();
        slid += u32::from(coarse.most_accurate().0 == "sliding");
    }
    assert!(slid > number / 2, "only {slid} slid");
}

/// On random scenes one pass keeps the tolerance, compared with RODAS at 1e-10 m.
#[test]
fn validate_one_pass_on_scenes_at_random() {
    let mut dice = Dice(0x2545_F491_4F6C_DD1D);
    for _ in 0..60 {
        let scene = dice.scene();
        keeps(&scene, &[1e-2, 1e-3, 1e-4, 1e-5, 1e-6], 0.003);
    }
}

/// Scenes in which a ball that seems to roll does not: it passes an edge between two nodes,
/// slips at the start, starts deep in the plate, or lies on a contact that oscillates.
#[test]
fn validate_one_pass_where_rolling_is_an_illusion() {
    let law = |term| Law::new(&[term]);
    let still = |qy| Laws::new(Law::default(), law(Term::Constant(qy)), Vec::new());
    let mut edge = on_the_chapters_plate(Contact::CHAPTER, 0.79);
    edge.edges = true;
    edge.initial.velocity.x = -0.4;
    edge.initial.spin.y = -0.4 / 0.0127;
    let slippery = Contact::new(8e5, 1000.0, 0.6, 1.0).unwrap();
    let mut slips = on_the_chapters_plate(slippery, 1.0);
    slips.initial.velocity.x = 0.5;
    let mut deep = on_the_chapters_plate(Contact::CHAPTER, 1.0);
    deep.initial.position.z -= 5e-4;
    let springy = Contact::new(200.0, 0.01, 0.6, 1e-4).unwrap();
    let sine = Term::Sine { amplitude: 0.1, frequency: 1.0, phase: 0.0 };
    let swings = Laws::new(Law::default(), law(sine), Vec::new());
    let scenes = [
        (edge, still(0.05714)),
        (slips, still(0.0)),
        (deep, still(0.1)),
        (on_the_chapters_plate(springy, 1.0), swings),
    ];
    for scene in scenes {
        keeps(&scene, &[1e-3, 1e-5], 0.01);
    }
}

#[test]
fn one_pass_declines_what_rounding_forbids() {
    let (scene, laws) = scene("steep");
    let declined = one_pass(&scene, &mut laws.clone(), 1e-12, None).unwrap_err().to_string();
    assert!(declined.starts_with("no model stays within 1e-12 m here: "), "{declined}");
}

#[test]
fn what_cannot_be_met_is_said() {
    let (scene, laws) = scene("steep");
    let refusal = choose(&scene, &laws, 1e-12).unwrap_err();
    assert!(refusal.best_m > 1e-12 && refusal.best_m < 1e-6, "{refusal}");
    assert!(!refusal.tried.is_empty());
    // The best accuracy is one for which there is a choice.
    assert!(choose(&scene, &laws, refusal.best_m).unwrap().error_m <= refusal.best_m);
}

/// A plate that stands still for longer than the longest step has all its candidates.
#[test]
fn a_long_scene_has_the_cheapest_candidates() {
    let (mut scene, laws) = scene("slope");
    scene.duration_s = 30.0;
    let tried = choose(&scene, &laws, 1e-3).unwrap().tried;
    let stepped = [Method::ZeroOrderHold, Method::Midpoint];
    assert!(stepped.iter().all(|m| tried.iter().any(|t| t.method == *m)), "{tried:?}");
}

/// A first piece shorter than the shortest step, in which the ball leaves the plate.
#[test]
fn fixed_implicit_steps_take_the_shortest_piece() {
    let (mut scene, _) = scene("slope");
    scene.initial.position.z += 1e-6;
    let law = Law::new(&[Term::Smoothstep { to: 0.2, start: -0.3, duration: 0.3 + 1e-10 }]);
    let laws = Laws::new(law.clone(), law, Vec::new());
    let by = configuration(Model::Compliant, Method::Rodas4, Pace::Step(1e-3));
    let end = run(&scene, &mut laws.clone(), &by, None).unwrap().end;
    assert!(end.to_row().iter().all(|value| value.is_finite()));
}

/// Random numbers in [0, 1) from a seed: xorshift64 (Marsaglia 2003).
struct Dice(u64);

impl Dice {
    fn roll(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.roll()
    }

    fn term(&mut self) -> Term {
        match (3.0 * self.roll()) as u32 {
            0 => Term::Constant(self.between(-0.3, 0.3)),
            1 => Term::Sine {
                amplitude: self.between(0.0, 0.4),
                frequency: self.between(0.1, 3.0),
                phase: self.between(0.0, 6.0),
            },
            _ => Term::Smoothstep {
                to: self.between(-1.4, 1.4),
                start: self.between(0.0, 0.5),
                duration: self.between(0.1, 0.6),
            },
        }
    }

    fn law(&mut self) -> Law {
        let terms: Vec<Term> = (0..(3.0 * self.roll()) as u32).map(|_| self.term()).collect();
        Law::new(&terms)
    }

    /// Draws a scene of 1 s with a random motion of the plate, a hard or soft contact, and
    /// a random friction.
    fn scene(&mut self) -> (Scene, Laws) {
        let (k, d) = if self.roll() < 0.5 { (1000.0, 100.0) } else { (800_000.0, 1000.0) };
        let contact = Contact::new(k, d, self.between(0.05, 1.0), 1e-4).unwrap();
        let laws = Laws::new(self.law(), self.law(), Vec::new());
        (on_the_chapters_plate(contact, 1.0), laws)
    }
}

/// On random scenes the choice meets the requested accuracy, compared with RODAS at
/// 1e-10 m. Of 20 000 choices on 4000 such scenes two exceeded it, by factors of 1.06 and
/// 1.15; none was declined.
#[test]
fn validate_the_choice_on_scenes_at_random() {
    let mut dice = Dice(0x9E37_79B9_7F4A_7C15);
    for _ in 0..40 {
        let scene = dice.scene();
        let tight = configuration(Model::Compliant, Method::Rodas4, Pace::Tolerance(1e-10));
        let truth = positions(&scene, &tight, 0.01);
        for tolerance in [1e-2, 1e-3, 1e-4, 1e-5, 1e-6] {
            let chosen = choose(&scene.0, &scene.1, tolerance).unwrap().configuration;
            let off = apart(&positions(&scene, &chosen, 0.01), &truth);
            assert!(off <= tolerance, "{chosen:?} is off by {off:e} m at {tolerance:e}");
        }
    }
}
