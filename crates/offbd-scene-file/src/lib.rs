//! The scene file: a body, a plate and the law of its motion, as JSON.

mod preset;

use nalgebra::{Vector2, Vector3};
use serde::Deserialize;

use self::preset::PresetOr;
use offbd_core::plant::{Ball, Contact, Motion, Plate};
use offbd_core::vocabulary::{Invalid, in_range, positive};
use offbd_lab::scene::{LONGEST_SCENE_S, Law, Laws, Push, Scene, Subject, Term};
use offbd_wire::asset::{BallView, ContactView, contact, plate_shape};
use offbd_wire::json;

/// The content of a scene file. Missing fields have the chapter's values.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SceneView {
    pub name: String,
    /// Duration, in (0, 3600] s.
    pub duration_s: f64,
    /// Whether the plate ends at its edges; if `false`, it is endless.
    pub edges: bool,
    pub ball: Option<BallView>,
    /// A block in place of the ball.
    pub block: Option<BlockView>,
    pub plate: PresetOr<ScenePlateView>,
    pub contact: PresetOr<ContactView>,
    pub initial: InitialView,
    /// Terms of the angle about x, at most [`MAX_TERMS`].
    pub qx: Vec<TermView>,
    /// Terms of the angle about y, at most [`MAX_TERMS`].
    pub qy: Vec<TermView>,
    /// Forces on the body's centre, at most [`MAX_PUSHES`].
    pub pushes: Vec<PushView>,
}

/// Largest number of terms of one angle: every evaluation sums them all, a hundred thousand
/// times per run.
pub const MAX_TERMS: usize = 64;

/// Largest number of pushes of a scene: each causes two discontinuities, at which every
/// method restarts.
pub const MAX_PUSHES: usize = 64;

/// Longest name, characters.
pub const MAX_NAME_CHARS: usize = 128;

impl Default for SceneView {
    /// The ball at rest on a level plate for the 0.6 s of the chapter's
    /// simulation (steps 48–50).
    fn default() -> Self {
        Self {
            name: "scene".to_owned(),
            duration_s: 0.6,
            edges: true,
            ball: None,
            block: None,
            plate: PresetOr::Value(ScenePlateView::default()),
            contact: PresetOr::Value(ContactView::default()),
            initial: InitialView::default(),
            qx: Vec::new(),
            qy: Vec::new(),
            pushes: Vec::new(),
        }
    }
}

/// A cube that slides without rotating.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct BlockView {
    /// Length of an edge, in (0, 1] m.
    pub edge_m: f64,
    /// Mass, in [1e-6, 100] kg.
    pub mass_kg: f64,
}

impl Default for BlockView {
    /// The chapter's cube of 12.7 mm. The chapter states no mass; the ball's is used.
    fn default() -> Self {
        Self { edge_m: 0.0127, mass_kg: Ball::default().mass_kg() }
    }
}

/// The plate: `length_m` and `width_m`, or `diameter_m` for a round one.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ScenePlateView {
    /// Length along x, in (0, 10] m.
    pub length_m: Option<f64>,
    /// Width along y, in (0, 10] m.
    pub width_m: Option<f64>,
    /// Diameter of a round plate, in (0, 10] m.
    pub diameter_m: Option<f64>,
    /// Thickness, in [0, 1] m.
    pub thickness_m: Option<f64>,
}

/// Initial motion of the body relative to the plate, in the plate frame.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct InitialView {
    /// Position of its centre, each coordinate within ±10 m; if missing, the body touches the
    /// plate's centre.
    pub position_m: Option<[f64; 3]>,
    /// Velocity, each component within ±100 m/s.
    pub velocity_m_s: [f64; 3],
    /// Angular velocity, each component within ±100 000 rad/s.
    pub spin_rad_s: [f64; 3],
}

/// One term of the law of an angle.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub enum TermView {
    ConstantRad(f64),
    Sine(SineView),
    Smoothstep(SmoothstepView),
}

/// `amplitude_rad·sin(2π·frequency_hz·t + phase_rad)`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SineView {
    pub amplitude_rad: f64,
    pub frequency_hz: f64,
    #[serde(default)]
    pub phase_rad: f64,
}

/// `to_rad·(3s² − 2s³)`; s rises from 0 at `start_s` to 1 within `duration_s`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SmoothstepView {
    pub to_rad: f64,
    #[serde(default)]
    pub start_s: f64,
    pub duration_s: f64,
}

/// A force on the body's centre for a limited time.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PushView {
    /// Force along the plate's x and y, each component within ±1000 N.
    pub force_n: [f64; 2],
    /// Start, in [0, 3600] s.
    #[serde(default)]
    pub start_s: f64,
    /// Duration, in (0, 3600] s.
    pub duration_s: f64,
}

/// A scene with its name and the laws of the plate's motion.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedScene {
    pub name: String,
    pub scene: Scene,
    pub laws: Laws,
}

/// Parses and checks a scene file.
///
/// # Errors
/// [`Invalid`] with the JSON pointer of the offending element; the empty
/// pointer stands for the document, with line and column in the reason.
pub fn parse(document: &[u8]) -> Result<NamedScene, Invalid> {
    json::check_object(document)?;
    named_scene(&json::parse(document)?)
}

fn named_scene(view: &SceneView) -> Result<NamedScene, Invalid> {
    let plate = view.plate.resolve("/plate", &Plate::PRESETS, plate)?;
    let contact = view.contact.resolve("/contact", &Contact::PRESETS, contact)?;
    let subject = subject(view, &plate)?;
    let mut scene = Scene::new(subject, plate, contact, view.duration_s)?;
    scene.edges = view.edges;
    scene.initial = initial(&view.initial, &scene)?;
    let laws = Laws::new(law("/qx", &view.qx)?, law("/qy", &view.qy)?, pushes(&view.pushes)?);
    Ok(NamedScene { name: name(&view.name)?, scene, laws })
}

fn name(name: &str) -> Result<String, Invalid> {
    let fits = (1..=MAX_NAME_CHARS).contains(&name.chars().count());
    if fits && !name.chars().any(char::is_control) {
        return Ok(name.to_owned());
    }
    let reason = format!("must be 1 to {MAX_NAME_CHARS} characters without control characters");
    Err(Invalid::new("/name", reason))
}

fn subject(view: &SceneView, plate: &Plate) -> Result<Subject, Invalid> {
    match (&view.ball, &view.block) {
        (Some(_), Some(_)) => {
            Err(Invalid::new("/block", "a scene has one body: give either `ball` or `block`"))
        }
        (_, Some(block)) => Scene::block(block.edge_m, block.mass_kg, plate),
        (ball, None) => {
            let ball = ball.clone().unwrap_or_default();
            Ball::new(ball.radius_m, ball.mass_kg, ball.inertia_factor).map(Subject::Ball)
        }
    }
}

fn plate(view: &ScenePlateView) -> Result<Plate, Invalid> {
    let shape = plate_shape(view.length_m, view.width_m, view.diameter_m)?;
    let chapter = Plate::CHAPTER;
    let thickness_m = view.thickness_m.unwrap_or(chapter.thickness_m());
    Plate::new(shape, thickness_m, chapter.rim())
}

fn initial(view: &InitialView, scene: &Scene) -> Result<Motion, Invalid> {
    let position = match &view.position_m {
        None => scene.initial.position,
        Some(position) => vector("/initial/position_m", position, 10.0)?,
    };
    Ok(Motion {
        position,
        velocity: vector("/initial/velocity_m_s", &view.velocity_m_s, 100.0)?,
        spin: vector("/initial/spin_rad_s", &view.spin_rad_s, 1e5)?,
    })
}

/// Checks that each of three numbers is within ±`max`.
fn vector(element: &str, values: &[f64; 3], max: f64) -> Result<Vector3<f64>, Invalid> {
    for (i, value) in values.iter().enumerate() {
        in_range(&format!("{element}/{i}"), *value, -max..=max)?;
    }
    Ok(Vector3::from(*values))
}

fn law(element: &str, views: &[TermView]) -> Result<Law, Invalid> {
    check_count(element, views.len(), MAX_TERMS)?;
    let terms = views.iter().enumerate();
    let terms: Result<Vec<Term>, Invalid> =
        terms.map(|(i, view)| term(view).checked(&format!("{element}/{i}"))).collect();
    Ok(Law::new(&terms?))
}

fn term(view: &TermView) -> Term {
    match view {
        TermView::ConstantRad(value) => Term::Constant(*value),
        TermView::Sine(sine) => Term::Sine {
            amplitude: sine.amplitude_rad,
            frequency: sine.frequency_hz,
            phase: sine.phase_rad,
        },
        TermView::Smoothstep(step) => {
            Term::Smoothstep { to: step.to_rad, start: step.start_s, duration: step.duration_s }
        }
    }
}

fn pushes(views: &[PushView]) -> Result<Vec<Push>, Invalid> {
    check_count("/pushes", views.len(), MAX_PUSHES)?;
    views.iter().enumerate().map(|(i, view)| push(&format!("/pushes/{i}"), view)).collect()
}

fn push(element: &str, view: &PushView) -> Result<Push, Invalid> {
    for (i, force) in view.force_n.iter().enumerate() {
        in_range(&format!("{element}/force_n/{i}"), *force, -1000.0..=1000.0)?;
    }
    let start = in_range(&format!("{element}/start_s"), view.start_s, 0.0..=LONGEST_SCENE_S)?;
    let duration = positive(&format!("{element}/duration_s"), view.duration_s, LONGEST_SCENE_S)?;
    Ok(Push { force: Vector2::from(view.force_n), start_s: start, duration_s: duration })
}

fn check_count(element: &str, n: usize, max: usize) -> Result<(), Invalid> {
    if n <= max {
        return Ok(());
    }
    Err(Invalid::new(element, format!("has {n} elements; at most {max} are allowed")))
}

#[cfg(test)]
mod tests;
