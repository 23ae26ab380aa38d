//! The asset file: a rig as JSON.

use data_encoding::HEXLOWER;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use utoipa::ToSchema;

use super::certificate::{self, MonitorCertificateView};
use offbd_core::diagnosis::{
    AxisCalibration, Calibration, Profile, Prospects, SensorCalibration, ServoProspects,
    SessionEstimate,
};
use offbd_core::engine::{AxisMapping, DiagnosticsSpec, Rig, ServoSpec};
use offbd_core::plant::{Ball, Contact, Plate, PlateShape};
use offbd_core::vocabulary::{Axis, Invalid, PerAxis, in_range, positive};

/// A rig as its owner describes it. Everything but `name` has a default: the
/// rig of the book chapter.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct AssetView {
    /// 1 to 128 letters, digits, `-`, `_` or `.`.
    #[schema(pattern = "^[A-Za-z0-9._-]{1,128}$")]
    pub name: String,
    /// Samples a second that the device sends, about.
    #[serde(default = "default_rate")]
    pub sample_rate_hz: f64,
    #[serde(default)]
    pub ball: BallView,
    #[serde(default)]
    pub plate: PlateView,
    /// How the ball touches the plate.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub contact: Option<ContactView>,
    #[serde(default)]
    pub servo: ServoView,
    /// How the device's numbers relate to the plate frame.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub axes: Option<AxesView>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub diagnostics: Option<DiagnosticsView>,
    /// Written by `calibrate`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub calibration: Option<CalibrationView>,
}

fn default_rate() -> f64 {
    100.0
}

/// The ball.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields, default)]
pub struct BallView {
    /// In (0, 1] m.
    #[schema(exclusive_minimum = 0, maximum = 1)]
    pub radius_m: f64,
    /// In (0, 100] kg.
    #[schema(exclusive_minimum = 0, maximum = 100)]
    pub mass_kg: f64,
    /// κ of I = κ m r², in [0, 1]: 0.4 solid, 0.667 hollow.
    #[schema(minimum = 0, maximum = 1)]
    pub inertia_factor: f64,
}

impl Default for BallView {
    fn default() -> Self {
        let ball = Ball::default();
        Self {
            radius_m: ball.radius_m(),
            mass_kg: ball.mass_kg(),
            inertia_factor: ball.inertia_factor(),
        }
    }
}

/// The plate: `length_m` and `width_m`, or `diameter_m` for a round one.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct PlateView {
    /// Along x, in (0, 10] m.
    #[schema(exclusive_minimum = 0, maximum = 10)]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub length_m: Option<f64>,
    /// Along y, in (0, 10] m.
    #[schema(exclusive_minimum = 0, maximum = 10)]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub width_m: Option<f64>,
    /// Of a round plate, in (0, 10] m.
    #[schema(exclusive_minimum = 0, maximum = 10)]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub diameter_m: Option<f64>,
    /// In [0, 1] m.
    #[schema(minimum = 0, maximum = 1)]
    #[serde(default = "default_thickness")]
    pub thickness_m: f64,
    /// Whether a rim stops the ball at the edge.
    #[serde(default = "default_rim")]
    pub rim: bool,
}

fn default_thickness() -> f64 {
    Plate::default().thickness_m()
}

fn default_rim() -> bool {
    Plate::default().rim()
}

impl Default for PlateView {
    fn default() -> Self {
        plate_view(&Plate::default())
    }
}

/// How a body touches the plate: spring, damper and friction.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ContactView {
    /// K, in (0, 1e12] N/m.
    #[schema(exclusive_minimum = 0, maximum = 1e12)]
    pub stiffness_n_per_m: f64,
    /// D, in (0, 1e9] N·s/m.
    #[schema(exclusive_minimum = 0, maximum = 1e9)]
    pub damping_n_s_per_m: f64,
    /// μ, in (0, 100].
    #[schema(exclusive_minimum = 0, maximum = 100)]
    pub friction: f64,
    /// Slip speed at which friction saturates, in (0, 10] m/s.
    #[schema(exclusive_minimum = 0, maximum = 10)]
    pub slip_threshold_m_s: f64,
}

impl Default for ContactView {
    fn default() -> Self {
        contact_view(&Contact::default())
    }
}

/// The servos, both of one kind.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ServoView {
    /// Largest plate angle, in (0, π/2] rad.
    pub angle_limit_rad: f64,
    /// From a command to the first movement, in [0, 5] s.
    #[schema(minimum = 0, maximum = 5)]
    pub dead_time_s: f64,
    /// First-order lag, in [0, 10] s.
    #[schema(minimum = 0, maximum = 10)]
    pub lag_s: f64,
    /// Fastest turn, in (0, 1000] rad/s.
    #[schema(exclusive_minimum = 0, maximum = 1000)]
    pub rate_limit_rad_s: f64,
}

impl Default for ServoView {
    fn default() -> Self {
        servo_view(&ServoSpec::default())
    }
}

/// How the device's numbers relate to the plate frame.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields, default)]
pub struct AxesView {
    /// Whether the device's x is the plate's y and the reverse.
    pub swap: bool,
    /// Sign of the readings along the plate's x, 1 or −1.
    pub x_sign: f64,
    /// Sign of the readings along the plate's y, 1 or −1.
    pub y_sign: f64,
    /// Metres per unit of the readings, 0.001 for millimetres.
    pub position_unit_m: f64,
    /// What is read along the plate's x in its middle, m after sign and unit, −10
    /// to 10; between end stops, the middle of what they leave.
    #[schema(minimum = -10, maximum = 10)]
    pub x_offset_m: f64,
    /// What is read along the plate's y in its middle, m after sign and unit, −10
    /// to 10; between end stops, the middle of what they leave.
    #[schema(minimum = -10, maximum = 10)]
    pub y_offset_m: f64,
    /// Radians per unit of the commands, 0.01745 for degrees.
    pub command_unit_rad: f64,
}

impl Default for AxesView {
    fn default() -> Self {
        axes_view(&AxisMapping::default())
    }
}

/// What the owner asks of the diagnosis.
#[derive(Clone, Debug, Default, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct DiagnosticsView {
    /// `default` or `textbook`.
    #[schema(pattern = "^(default|textbook)$")]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub profile: Option<String>,
    /// Wanted false alarms per rig and year, above 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub false_alarms_per_rig_year: Option<f64>,
    /// Continuous failure before a test fails, in [0, 60] s: of servos, ball and
    /// sensor.
    #[schema(minimum = 0, maximum = 60)]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub debounce_s: Option<f64>,
}

/// What was learnt of a rig, from which data, when.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CalibrationView {
    /// Derived from the rest; every fault carries it. Ignored when read.
    #[serde(default)]
    pub id: String,
    /// RFC 3339.
    pub made_at: String,
    /// SHA-256 of the data.
    pub data_sha256: String,
    pub samples: u64,
    pub duration_s: f64,
    /// None where the rig has no such servo.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub x: Option<AxisCalibrationView>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub y: Option<AxisCalibrationView>,
    /// What was learnt of the sensor.
    #[serde(default)]
    pub sensor: SensorCalibrationView,
    /// What each session says by itself, in the order in which they were given.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub sessions: Vec<SessionEstimatesView>,
    /// How near each monitor came to an alarm in the tests of the calibration, and
    /// how often it will; empty where it was not tested.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub certificate: Vec<MonitorCertificateView>,
    /// What can be found, how soon.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub prospects: Option<ProspectsView>,
}

/// What was learnt of the sensor.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SensorCalibrationView {
    /// Time between two readings of a sensor that is logged faster than it reads,
    /// in [0, 10] s; 0 for one that is not.
    #[schema(minimum = 0, maximum = 10)]
    pub refresh_s: f64,
    /// Most lone readings within ten seconds that were set aside, in [0, 1e6].
    #[schema(minimum = 0, maximum = 1e6)]
    pub most_outliers: f64,
    /// Most scatter about the motion that lasted, in [0, 1] m; 0 if not known.
    #[schema(minimum = 0, maximum = 1)]
    pub most_scatter_m: f64,
    /// Longest time for which no ball was seen on the plate, in [0, 60] s.
    #[schema(minimum = 0, maximum = 60)]
    pub longest_unseen_s: f64,
}

/// What one session says of each axis; none where it says nothing.
#[derive(Clone, Debug, Default, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SessionEstimatesView {
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub x: Option<SessionEstimateView>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub y: Option<SessionEstimateView>,
}

/// What one session says of one axis.
#[derive(Clone, Copy, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SessionEstimateView {
    /// Plate and horn off level, rad, and its standard error.
    pub level_rad: f64,
    pub level_error_rad: f64,
    /// Gain and its standard error; none where the ball did not move.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gain: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gain_error: Option<f64>,
}

/// How soon a fault would have been confirmed, had it come during the sessions
/// that were learnt from: medians over trials, in which the fault was put into
/// the readings. Null where fewer than half of them found it within 10 s.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ProspectsView {
    /// Moments at which each fault was put in.
    pub trials: usize,
    /// None where nothing was learnt of the axis.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub x: Option<ServoProspectsView>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub y: Option<ServoProspectsView>,
    /// A ball that sticks, s.
    pub stuck_s: Option<f64>,
    /// Readings that freeze, s.
    pub frozen_s: Option<f64>,
    /// A ball that is not seen, s.
    pub unseen_s: Option<f64>,
}

/// The same for one axis' servo.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ServoProspectsView {
    /// One that does not answer, s.
    pub dead_s: Option<f64>,
    /// One that answers half, s.
    pub half_gain_s: Option<f64>,
    /// One whose horn has slipped by 1°, s.
    pub offset_1deg_s: Option<f64>,
    /// Smallest share of the gain, of those tried, whose loss is found.
    pub least_gain_loss: Option<f64>,
    /// Smallest slip of the horn, of those tried, that is found, rad.
    pub least_offset_rad: Option<f64>,
}

/// One axis as learnt.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct AxisCalibrationView {
    /// Measured over modelled acceleration, in [−100, 100].
    pub gain: f64,
    pub dead_time_s: f64,
    pub lag_s: f64,
    /// Plate and horn off level, rad: the mean over sessions.
    pub level_rad: f64,
    /// Standard deviation of the level from session to session, in [0, 1] rad.
    #[schema(minimum = 0, maximum = 1)]
    #[serde(default = "default_level_spread")]
    pub level_spread_rad: f64,
    /// Standard deviation of the gain from session to session, as a share of it,
    /// in [0, 10].
    #[schema(minimum = 0, maximum = 10)]
    #[serde(default = "default_gain_spread")]
    pub gain_spread: f64,
    /// Deceleration of a rolling ball, m/s²; zero where it was not learnt.
    #[serde(default)]
    pub resistance_m_s2: f64,
    pub noise_m: f64,
    pub breakaway_rad: f64,
    pub residual_m_s2: f64,
    /// Acceleration up to which gain and delay were learnt, m/s²; none where that
    /// is not known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub familiar_m_s2: Option<f64>,
    /// Longest time for which healthy readings were the same to the bit, in
    /// [0, 60] s.
    #[schema(minimum = 0, maximum = 60)]
    #[serde(default = "default_repeat")]
    pub longest_repeat_s: f64,
    /// Longest time for which the ball was seen at rest, in [0, 1e9] s; where it was not,
    /// the breakaway angle is unknown.
    #[schema(minimum = 0, maximum = 1e9)]
    #[serde(default)]
    pub rest_s: f64,
    /// Acceleration that the twin leaves out, over half a second, in (0, 100]
    /// m/s²; assumed from the residual where it was not learnt.
    #[schema(exclusive_minimum = 0, maximum = 100)]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub model_error_m_s2: Option<f64>,
    /// Most evidence against the servo while it was healthy, in [0, 1000] nats.
    #[schema(minimum = 0, maximum = 1000)]
    #[serde(default)]
    pub most_nats: f64,
    /// The most that the path is expected to bend from the twin's over two seconds while
    /// the servo is healthy, root mean square, in [0, 1] m: what tests have shown, and
    /// more where they were few. Zero where that is not known, and then no path is judged.
    #[schema(minimum = 0, maximum = 1)]
    #[serde(default)]
    pub most_path_error_m: f64,
}

const fn default_level_spread() -> f64 {
    AxisCalibration::POPULATION_LEVEL_SPREAD_RAD
}

const fn default_gain_spread() -> f64 {
    AxisCalibration::POPULATION_GAIN_SPREAD
}

/// Healthy readings are known to repeat themselves for this long, s.
const fn default_repeat() -> f64 {
    0.15
}

/// Parses and checks an asset file.
///
/// # Errors
/// [`Invalid`] with the JSON pointer of the offending element; the empty
/// pointer stands for the document, with line and column in the reason.
pub fn parse(document: &[u8]) -> Result<Rig, Invalid> {
    check_object(document)?;
    let mut json = serde_json::Deserializer::from_slice(document);
    let view: AssetView = serde_path_to_error::deserialize(&mut json)
        .map_err(|e| Invalid::new(pointer(e.path()), e.inner().to_string()))?;
    json.end().map_err(|e| Invalid::new("", e.to_string()))?;
    rig(&view)
}

/// That a document is not a list: serde would take one of an object's values, in
/// their order, for the object.
///
/// # Errors
/// [`Invalid`] about the whole document.
pub fn check_object(document: &[u8]) -> Result<(), Invalid> {
    if document.trim_ascii_start().starts_with(b"[") {
        return Err(Invalid::new("", "is a list, not an object"));
    }
    Ok(())
}

/// JSON pointer (RFC 6901) of a path inside a document.
#[must_use]
pub fn pointer(path: &serde_path_to_error::Path) -> String {
    use serde_path_to_error::Segment;
    let token = |segment: &Segment| match segment {
        Segment::Seq { index } => Some(format!("/{index}")),
        Segment::Map { key } => Some(format!("/{}", key.replace('~', "~0").replace('/', "~1"))),
        // The word of a choice is a key in the document.
        Segment::Enum { variant } => Some(format!("/{variant}")),
        Segment::Unknown => None,
    };
    path.iter().filter_map(token).collect()
}

/// The rig that a view describes.
///
/// # Errors
/// [`Invalid`] with the JSON pointer of the first element that cannot be.
pub fn rig(view: &AssetView) -> Result<Rig, Invalid> {
    let rig = Rig {
        name: view.name.clone(),
        sample_rate_hz: view.sample_rate_hz,
        ball: Ball::new(view.ball.radius_m, view.ball.mass_kg, view.ball.inertia_factor)?,
        plate: plate(&view.plate)?,
        contact: contact(&view.contact.clone().unwrap_or_default())?,
        servo: ServoSpec {
            angle_limit_rad: view.servo.angle_limit_rad,
            dead_time_s: view.servo.dead_time_s,
            lag_s: view.servo.lag_s,
            rate_limit_rad_s: view.servo.rate_limit_rad_s,
        },
        mapping: mapping(&view.axes.clone().unwrap_or_default())?,
        diagnostics: diagnostics(&view.diagnostics.clone().unwrap_or_default())?,
        calibration: view.calibration.as_ref().map(calibration).transpose()?,
    };
    rig.check()?;
    Ok(rig)
}

fn plate(view: &PlateView) -> Result<Plate, Invalid> {
    let shape = outline(view.length_m, view.width_m, view.diameter_m)?;
    Plate::new(shape, view.thickness_m, view.rim)
}

/// The outline that these sizes stand for; what is missing is the chapter's.
pub(super) fn outline(
    length_m: Option<f64>,
    width_m: Option<f64>,
    diameter_m: Option<f64>,
) -> Result<PlateShape, Invalid> {
    match (diameter_m, length_m, width_m) {
        (Some(diameter_m), None, None) => Ok(PlateShape::Round { diameter_m }),
        (Some(_), ..) => {
            let reason = "a round plate has neither length_m nor width_m";
            Err(Invalid::new("/plate/diameter_m", reason))
        }
        (None, length_m, width_m) => {
            let PlateShape::Rectangle { length_m: l, width_m: w } = Plate::default().shape() else {
                unreachable!("the default plate is a rectangle")
            };
            let (length_m, width_m) = (length_m.unwrap_or(l), width_m.unwrap_or(w));
            Ok(PlateShape::Rectangle { length_m, width_m })
        }
    }
}

/// The contact that a view describes.
///
/// # Errors
/// [`Invalid`] naming the element under `/contact`.
pub fn contact(view: &ContactView) -> Result<Contact, Invalid> {
    Contact::new(
        view.stiffness_n_per_m,
        view.damping_n_s_per_m,
        view.friction,
        view.slip_threshold_m_s,
    )
}

fn mapping(view: &AxesView) -> Result<AxisMapping, Invalid> {
    for (element, sign) in [("/axes/x_sign", view.x_sign), ("/axes/y_sign", view.y_sign)] {
        if sign.abs() != 1.0 {
            return Err(Invalid::new(element, format!("{sign} is neither 1 nor -1")));
        }
    }
    Ok(AxisMapping {
        swap: view.swap,
        sign: PerAxis { x: view.x_sign, y: view.y_sign },
        position_unit_m: view.position_unit_m,
        origin_m: PerAxis { x: view.x_offset_m, y: view.y_offset_m },
        command_unit_rad: view.command_unit_rad,
    })
}

fn axes_view(mapping: &AxisMapping) -> AxesView {
    AxesView {
        swap: mapping.swap,
        x_sign: mapping.sign.x,
        y_sign: mapping.sign.y,
        position_unit_m: mapping.position_unit_m,
        x_offset_m: mapping.origin_m.x,
        y_offset_m: mapping.origin_m.y,
        command_unit_rad: mapping.command_unit_rad,
    }
}

fn diagnostics(view: &DiagnosticsView) -> Result<DiagnosticsSpec, Invalid> {
    let profile = match &view.profile {
        None => Profile::default(),
        Some(word) => word.parse().map_err(|e: offbd_core::vocabulary::UnknownWord| {
            Invalid::new("/diagnostics/profile", e.to_string())
        })?,
    };
    Ok(DiagnosticsSpec {
        profile,
        false_alarms_per_rig_year: view.false_alarms_per_rig_year,
        debounce_s: view.debounce_s,
    })
}

fn calibration(view: &CalibrationView) -> Result<Calibration, Invalid> {
    let learn = |axis: Axis, view: &Option<AxisCalibrationView>| {
        view.as_ref().map(|v| axis_calibration(axis, v)).transpose()
    };
    Ok(Calibration {
        axes: PerAxis { x: learn(Axis::X, &view.x)?, y: learn(Axis::Y, &view.y)? },
        sensor: sensor_calibration(&view.sensor)?,
        sessions: view.sessions.iter().map(session_estimates).collect(),
        data_sha256: view.data_sha256.clone(),
        n_samples: view.samples,
        duration_s: view.duration_s,
        made_at: view.made_at.clone(),
        certificate: certificate::certificate(&view.certificate)?,
        prospects: view.prospects.as_ref().map(prospects),
    })
}

fn sensor_calibration(view: &SensorCalibrationView) -> Result<SensorCalibration, Invalid> {
    let at = |field: &str| format!("/calibration/sensor/{field}");
    Ok(SensorCalibration {
        refresh_s: in_range(&at("refresh_s"), view.refresh_s, 0.0..=10.0)?,
        most_outliers: in_range(&at("most_outliers"), view.most_outliers, 0.0..=1e6)?,
        most_scatter_m: in_range(&at("most_scatter_m"), view.most_scatter_m, 0.0..=1.0)?,
        longest_unseen_s: in_range(&at("longest_unseen_s"), view.longest_unseen_s, 0.0..=60.0)?,
    })
}

fn session_estimates(view: &SessionEstimatesView) -> PerAxis<Option<SessionEstimate>> {
    let estimate = |v: SessionEstimateView| SessionEstimate {
        level_rad: v.level_rad,
        level_error_rad: v.level_error_rad,
        gain: v.gain.zip(v.gain_error),
    };
    PerAxis { x: view.x.map(estimate), y: view.y.map(estimate) }
}

fn session_estimates_view(session: &PerAxis<Option<SessionEstimate>>) -> SessionEstimatesView {
    let estimate = |s: SessionEstimate| SessionEstimateView {
        level_rad: s.level_rad,
        level_error_rad: s.level_error_rad,
        gain: s.gain.map(|(gain, _)| gain),
        gain_error: s.gain.map(|(_, error)| error),
    };
    SessionEstimatesView { x: session.x.map(estimate), y: session.y.map(estimate) }
}

fn prospects(view: &ProspectsView) -> Prospects {
    let servo = |v: &ServoProspectsView| ServoProspects {
        dead_s: v.dead_s,
        half_gain_s: v.half_gain_s,
        offset_1deg_s: v.offset_1deg_s,
        least_gain_loss: v.least_gain_loss,
        least_offset_rad: v.least_offset_rad,
    };
    Prospects {
        n_trials: view.trials,
        servos: PerAxis { x: view.x.as_ref().map(servo), y: view.y.as_ref().map(servo) },
        stuck_s: view.stuck_s,
        frozen_s: view.frozen_s,
        unseen_s: view.unseen_s,
    }
}

fn prospects_view(prospects: &Prospects) -> ProspectsView {
    let servo = |p: ServoProspects| ServoProspectsView {
        dead_s: p.dead_s,
        half_gain_s: p.half_gain_s,
        offset_1deg_s: p.offset_1deg_s,
        least_gain_loss: p.least_gain_loss,
        least_offset_rad: p.least_offset_rad,
    };
    ProspectsView {
        trials: prospects.n_trials,
        x: prospects.servos.x.map(servo),
        y: prospects.servos.y.map(servo),
        stuck_s: prospects.stuck_s,
        frozen_s: prospects.frozen_s,
        unseen_s: prospects.unseen_s,
    }
}

fn axis_calibration(axis: Axis, view: &AxisCalibrationView) -> Result<AxisCalibration, Invalid> {
    let at = |field: &str| format!("/calibration/{}/{field}", axis.as_str());
    Ok(AxisCalibration {
        gain: in_range(&at("gain"), view.gain, -100.0..=100.0)?,
        dead_time_s: in_range(&at("dead_time_s"), view.dead_time_s, 0.0..=5.0)?,
        lag_s: in_range(&at("lag_s"), view.lag_s, 0.0..=10.0)?,
        level_rad: in_range(&at("level_rad"), view.level_rad, -1.0..=1.0)?,
        resistance_m_s2: in_range(&at("resistance_m_s2"), view.resistance_m_s2, 0.0..=10.0)?,
        noise_m: positive(&at("noise_m"), view.noise_m, 1.0)?,
        breakaway_rad: in_range(&at("breakaway_rad"), view.breakaway_rad, 0.0..=1.0)?,
        residual_m_s2: positive(&at("residual_m_s2"), view.residual_m_s2, 100.0)?,
        familiar_m_s2: view.familiar_m_s2.map_or(Ok(f64::INFINITY), |familiar| {
            in_range(&at("familiar_m_s2"), familiar, 0.0..=1e3)
        })?,
        level_spread_rad: in_range(&at("level_spread_rad"), view.level_spread_rad, 0.0..=1.0)?,
        gain_spread: in_range(&at("gain_spread"), view.gain_spread, 0.0..=10.0)?,
        longest_repeat_s: in_range(&at("longest_repeat_s"), view.longest_repeat_s, 0.0..=60.0)?,
        rest_s: in_range(&at("rest_s"), view.rest_s, 0.0..=1e9)?,
        model_error_m_s2: match view.model_error_m_s2 {
            Some(error) => positive(&at("model_error_m_s2"), error, 100.0)?,
            None => AxisCalibration::assumed_model_error_m_s2(view.residual_m_s2),
        },
        most_path_error_m: in_range(&at("most_path_error_m"), view.most_path_error_m, 0.0..=1.0)?,
        most_nats: in_range(&at("most_nats"), view.most_nats, 0.0..=1e3)?,
    })
}

/// The view of a rig, as `calibrate` writes it and the registry returns it.
#[must_use]
pub fn view(rig: &Rig) -> AssetView {
    AssetView {
        name: rig.name.clone(),
        sample_rate_hz: rig.sample_rate_hz,
        ball: BallView {
            radius_m: rig.ball.radius_m(),
            mass_kg: rig.ball.mass_kg(),
            inertia_factor: rig.ball.inertia_factor(),
        },
        plate: plate_view(&rig.plate),
        contact: (rig.contact != Contact::default()).then(|| contact_view(&rig.contact)),
        servo: servo_view(&rig.servo),
        axes: (rig.mapping != AxisMapping::default()).then(|| axes_view(&rig.mapping)),
        diagnostics: (rig.diagnostics != DiagnosticsSpec::default()).then(|| DiagnosticsView {
            profile: Some(rig.diagnostics.profile.to_string()),
            false_alarms_per_rig_year: rig.diagnostics.false_alarms_per_rig_year,
            debounce_s: rig.diagnostics.debounce_s,
        }),
        calibration: rig.calibration.as_ref().map(calibration_view),
    }
}

fn plate_view(plate: &Plate) -> PlateView {
    let (length_m, width_m, diameter_m) = match plate.shape() {
        PlateShape::Rectangle { length_m, width_m } => (Some(length_m), Some(width_m), None),
        PlateShape::Round { diameter_m } => (None, None, Some(diameter_m)),
    };
    let (thickness_m, rim) = (plate.thickness_m(), plate.rim());
    PlateView { length_m, width_m, diameter_m, thickness_m, rim }
}

fn contact_view(contact: &Contact) -> ContactView {
    ContactView {
        stiffness_n_per_m: contact.stiffness_n_per_m(),
        damping_n_s_per_m: contact.damping_n_s_per_m(),
        friction: contact.friction(),
        slip_threshold_m_s: contact.slip_threshold_m_s(),
    }
}

fn servo_view(servo: &ServoSpec) -> ServoView {
    ServoView {
        angle_limit_rad: servo.angle_limit_rad,
        dead_time_s: servo.dead_time_s,
        lag_s: servo.lag_s,
        rate_limit_rad_s: servo.rate_limit_rad_s,
    }
}

/// The view of a calibration.
#[must_use]
pub fn calibration_view(calibration: &Calibration) -> CalibrationView {
    let axis = |c: &AxisCalibration| AxisCalibrationView {
        gain: c.gain,
        dead_time_s: c.dead_time_s,
        lag_s: c.lag_s,
        level_rad: c.level_rad,
        resistance_m_s2: c.resistance_m_s2,
        noise_m: c.noise_m,
        breakaway_rad: c.breakaway_rad,
        residual_m_s2: c.residual_m_s2,
        familiar_m_s2: c.familiar_m_s2.is_finite().then_some(c.familiar_m_s2),
        level_spread_rad: c.level_spread_rad,
        gain_spread: c.gain_spread,
        longest_repeat_s: c.longest_repeat_s,
        rest_s: c.rest_s,
        model_error_m_s2: Some(c.model_error_m_s2),
        most_nats: c.most_nats,
        most_path_error_m: c.most_path_error_m,
    };
    CalibrationView {
        id: calibration_id(calibration),
        made_at: calibration.made_at.clone(),
        data_sha256: calibration.data_sha256.clone(),
        samples: calibration.n_samples,
        duration_s: calibration.duration_s,
        x: calibration.axes.x.as_ref().map(axis),
        y: calibration.axes.y.as_ref().map(axis),
        sensor: SensorCalibrationView {
            refresh_s: calibration.sensor.refresh_s,
            most_outliers: calibration.sensor.most_outliers,
            most_scatter_m: calibration.sensor.most_scatter_m,
            longest_unseen_s: calibration.sensor.longest_unseen_s,
        },
        sessions: calibration.sessions.iter().map(session_estimates_view).collect(),
        certificate: calibration.certificate.as_ref().map_or(Vec::new(), certificate::view),
        prospects: calibration.prospects.as_ref().map(prospects_view),
    }
}

/// The id by which faults name the calibration that judged them: the first 16
/// hexadecimal digits of the SHA-256 of what was learnt and from what.
#[must_use]
pub fn calibration_id(calibration: &Calibration) -> String {
    let mut hash = Sha256::new();
    hash.update(calibration.data_sha256.as_bytes());
    for learnt in Axis::ALL.into_iter().filter_map(|axis| calibration.axes[axis]) {
        for number in [
            learnt.gain,
            learnt.dead_time_s,
            learnt.lag_s,
            learnt.level_rad,
            learnt.resistance_m_s2,
            learnt.noise_m,
            learnt.breakaway_rad,
            learnt.residual_m_s2,
            learnt.familiar_m_s2,
            learnt.level_spread_rad,
            learnt.gain_spread,
            learnt.longest_repeat_s,
            learnt.rest_s,
            learnt.model_error_m_s2,
            learnt.most_nats,
        ] {
            hash.update(number.to_bits().to_le_bytes());
        }
        // Calibrations without it keep their ids.
        if learnt.most_path_error_m > 0.0 {
            hash.update(learnt.most_path_error_m.to_bits().to_le_bytes());
        }
    }
    let SensorCalibration { refresh_s, most_outliers, most_scatter_m, longest_unseen_s } =
        calibration.sensor;
    for number in [refresh_s, most_outliers, most_scatter_m, longest_unseen_s] {
        hash.update(number.to_bits().to_le_bytes());
    }
    HEXLOWER.encode(&hash.finalize()[..8])
}

#[cfg(test)]
mod tests {
    use super::*;
    use offbd_core::diagnosis::MonitorCertificate;

    #[test]
    fn a_name_is_enough() {
        assert_eq!(parse(br#"{"name":"a"}"#).unwrap(), Rig::chapter("a"));
    }

    #[test]
    fn a_rig_survives_the_round_trip() {
        let learnt = AxisCalibration {
            gain: 0.9,
            dead_time_s: 0.03,
            lag_s: 0.07,
            level_rad: -0.01,
            resistance_m_s2: 0.02,
            noise_m: 4e-4,
            breakaway_rad: 0.005,
            residual_m_s2: 0.02,
            familiar_m_s2: 0.4,
            level_spread_rad: 0.01,
            gain_spread: 0.03,
            longest_repeat_s: 0.4,
            rest_s: 12.0,
            model_error_m_s2: 0.03,
            most_nats: 4.5,
            most_path_error_m: 3e-3,
        };
        let estimate =
            SessionEstimate { level_rad: -0.02, level_error_rad: 1e-3, gain: Some((0.8, 0.02)) };
        let mut rig = Rig::chapter("b");
        rig.plate = Plate::new(PlateShape::Round { diameter_m: 0.3 }, 0.005, false).unwrap();
        rig.mapping.swap = true;
        rig.mapping.origin_m.y = -0.02;
        rig.diagnostics.debounce_s = Some(2.0);
        rig.calibration = Some(Calibration {
            axes: PerAxis { x: Some(learnt), y: None },
            sensor: SensorCalibration {
                refresh_s: 0.05,
                most_outliers: 2.0,
                most_scatter_m: 1e-3,
                longest_unseen_s: 0.4,
            },
            sessions: vec![PerAxis { x: Some(estimate), y: None }, PerAxis::default()],
            data_sha256: "00".to_owned(),
            n_samples: 12,
            duration_s: 1.5,
            made_at: "2026-01-01T00:00:00Z".to_owned(),
            certificate: Some(std::array::from_fn(|i| MonitorCertificate {
                judged_s: 300.0,
                nearest: 0.25 * i as f64,
                alarms_per_hour: (i > 0).then_some(0.01),
            })),
            prospects: Some(Prospects {
                n_trials: 12,
                servos: PerAxis {
                    x: Some(ServoProspects { dead_s: Some(0.5), ..ServoProspects::default() }),
                    y: None,
                },
                stuck_s: Some(1.5),
                ..Prospects::default()
            }),
        });
        let json = serde_json::to_vec(&view(&rig)).unwrap();
        assert_eq!(parse(&json).unwrap(), rig);
    }

    #[test]
    fn what_is_wrong_is_named() {
        let cases = [
            (r#"{"name":"a","ball":{"radius_m":-1}}"#, "/ball/radius_m", "not above 0"),
            (r#"{"name":"a","ball":{"radius_m":"x"}}"#, "/ball/radius_m", "invalid type"),
            (r#"{"name":"a","bal":{}}"#, "/bal", "unknown field"),
            (r#"{"name":"a b"}"#, "/name", "letters"),
            (r#"{"ball":{}}"#, "", "missing field `name`"),
            (r#"{"name":"a","plate":{"diameter_m":1,"width_m":1}}"#, "/plate/diameter_m", "round"),
            (r#"{"name":"a","axes":{"x_sign":2}}"#, "/axes/x_sign", "neither"),
            (r#"{"name":"a","axes":{"y_offset_m":20}}"#, "/axes/y_offset_m", "outside"),
            (r#"{"name":"a","diagnostics":{"profile":"best"}}"#, "/diagnostics/profile", "best"),
            (r#"{"name":"a","servo":{"lag_s":-0.1}}"#, "/servo/lag_s", "outside"),
            (r#"{"name":"a","sample_rate_hz":1e999}"#, "/sample_rate_hz", "number out of range"),
            (r#"{"name":"a"} x"#, "", "trailing"),
        ];
        for (document, element, reason) in cases {
            let error = parse(document.as_bytes()).unwrap_err();
            assert_eq!(error.element, element, "{document}: {error}");
            assert!(error.reason.contains(reason), "{document}: {error}");
        }
    }
}
