use super::*;

/// The example of the contract, verbatim.
const CONTRACT: &str = r#"
    { "name": "sine", "duration_s": 10, "edges": false,
      "ball": { "radius_m": 0.0127, "mass_kg": 0.051, "inertia_factor": 0.4 },
      "contact": { "stiffness_n_per_m": 800000, "damping_n_s_per_m": 1000, "friction": 0.6, "slip_threshold_m_s": 1e-4 },
      "initial": { "position_m": [0, 0, 0.0227], "velocity_m_s": [0, 0, 0], "spin_rad_s": [0, 0, 0] },
      "qx": [ { "sine": { "amplitude_rad": 0.05, "frequency_hz": 0.7, "phase_rad": 0 } } ],
      "qy": [ { "constant_rad": 0.01 }, { "smoothstep": { "to_rad": 1.2, "start_s": 0, "duration_s": 0.15 } } ] }"#;

fn error(text: &str) -> Invalid {
    parse(text.as_bytes()).unwrap_err()
}

#[test]
fn the_contracts_example_is_parsed() {
    let NamedScene { name, scene, laws } = parse(CONTRACT.as_bytes()).unwrap();
    assert_eq!((name.as_str(), scene.duration_s, scene.edges), ("sine", 10.0, false));
    assert_eq!(scene.subject, Subject::Ball(Ball::default()));
    assert_eq!((scene.contact, scene.plate), (Contact::CHAPTER, Plate::CHAPTER));
    let qx = [Term::Sine { amplitude: 0.05, frequency: 0.7, phase: 0.0 }];
    let qy = [Term::Constant(0.01), Term::Smoothstep { to: 1.2, start: 0.0, duration: 0.15 }];
    assert_eq!(laws, Laws::new(Law::new(&qx), Law::new(&qy), Vec::new()));
}

#[test]
fn missing_fields_have_the_chapters_values() {
    let scene = parse(b"{}").unwrap().scene;
    assert_eq!((scene.plate, scene.contact), (Plate::CHAPTER, Contact::CHAPTER));
    // 0.01 + 0.0127, apart from rounding.
    assert!((scene.initial.position - Vector3::new(0.0, 0.0, 0.0227)).norm() < 1e-15);
    assert!(scene.edges);
    let parts = parse(br#"{"contact":{"friction":0.3},"plate":{"width_m":0.25}}"#).unwrap().scene;
    assert_eq!(parts.contact, Contact::new(800_000.0, 1000.0, 0.3, 1e-4).unwrap());
    assert_eq!(parts.plate, Plate::STEP_12);
}

#[test]
fn plates_and_contacts_can_be_given_by_the_name_of_a_preset() {
    let of = |text: &str| parse(text.as_bytes()).unwrap().scene;
    assert_eq!(of(r#"{"contact":"soft"}"#).contact, Contact::SOFT);
    assert_eq!(of(r#"{"plate":"section-4.8"}"#).plate, Plate::SECTION_4_8);
    let unknown = error(r#"{"plate":"moon"}"#);
    assert_eq!(unknown.element, "/plate");
    assert!(unknown.reason.contains("chapter, step-12, section-4.8"), "{unknown}");
}

#[test]
fn a_block_starts_at_rest_on_the_plate() {
    let scene = parse(br#"{"block":{"edge_m":0.02}}"#).unwrap().scene;
    assert_eq!(scene.initial.position.z, 0.02);
    assert!(matches!(scene.subject, Subject::Block(block) if block.mass_kg == 0.051));
}

#[test]
fn an_error_has_the_pointer_of_the_invalid_element() {
    for (text, element) in [
        (r#"{"durations":1}"#, "/durations"),
        (r#"{"duration_s":0}"#, "/duration_s"),
        (r#"{"duration_s":1e999}"#, "/duration_s"),
        (r#"{"ball":{"radius_m":-1}}"#, "/ball/radius_m"),
        (r#"{"ball":{"colour":1}}"#, "/ball/colour"),
        (r#"{"ball":{},"block":{}}"#, "/block"),
        (r#"{"block":{"edge_m":0}}"#, "/block/edge_m"),
        (r#"{"plate":{"diameter_m":1,"width_m":1}}"#, "/plate/diameter_m"),
        (r#"{"plate":7}"#, "/plate"),
        (r#"{"contact":{"friction":"much"}}"#, "/contact/friction"),
        (r#"{"contact":{"stiffness_n_per_m":0}}"#, "/contact/stiffness_n_per_m"),
        (r#"{"initial":{"position_m":[0,0,11]}}"#, "/initial/position_m/2"),
        (r#"{"initial":{"spin_rad_s":[0,"a",0]}}"#, "/initial/spin_rad_s/1"),
        (
            r#"{"qx":[{"constant_rad":0},{"sine":{"amplitude_rad":7,"frequency_hz":1}}]}"#,
            "/qx/1/sine/amplitude_rad",
        ),
        (r#"{"qy":[{"sine":{"amplitude_rad":"x","frequency_hz":1}}]}"#, "/qy/0/sine/amplitude_rad"),
        (r#"{"qy":[{"smoothstep":{"to_rad":1,"duration_s":0}}]}"#, "/qy/0/smoothstep/duration_s"),
        (r#"{"qy":[{"constant_rad":99}]}"#, "/qy/0/constant_rad"),
        (r#"{"pushes":[{"force_n":[1,1e9],"duration_s":1}]}"#, "/pushes/0/force_n/1"),
        (r#"{"pushes":[{"force_n":[1,1],"start_s":-1,"duration_s":1}]}"#, "/pushes/0/start_s"),
        (r#"{"name":""}"#, "/name"),
        ("{", ""),
        ("{} {}", ""),
    ] {
        let wrong = error(text);
        assert_eq!(wrong.element, element, "{text}: {wrong}");
    }
    assert!(error(r#"{"qx":[{"cosine":{}}]}"#).to_string().starts_with("/qx/0"));
}

#[test]
fn the_numbers_of_terms_and_pushes_are_limited() {
    let terms = vec![r#"{"constant_rad":0.001}"#; MAX_TERMS + 1].join(",");
    assert_eq!(error(&format!(r#"{{"qx":[{terms}]}}"#)).element, "/qx");
    let pushes = vec![r#"{"force_n":[0,0],"duration_s":1}"#; MAX_PUSHES + 1].join(",");
    assert_eq!(error(&format!(r#"{{"pushes":[{pushes}]}}"#)).element, "/pushes");
}
