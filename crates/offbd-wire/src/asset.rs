//! The asset file: a rig as JSON.

use data_encoding::HEXLOWER;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use utoipa::ToSchema;

use super::certificate::{self, MonitorCertificateView};
use super::json;
use super::table::ColumnMapping;
use super::words::ProfileWord;
use offbd_core::diagnosis::{
    AxisCalibration, Calibration, CalibrationOrigin, Contradiction, LeftOut, Prospects,
    SensorCalibration, ServoProspects, SessionEstimate,
};
use offbd_core::engine::{AxisMapping, DiagnosticsSpec, Rig, ServoSpec};
use offbd_core::plant::{Ball, Contact, Plate, PlateShape};
use offbd_core::vocabulary::{Axis, Invalid, PerAxis, in_range, positive};

/// The description of a rig by its owner. Everything but `name` has a default: that of
/// the default rig (plate 0.38 × 0.24 m, steel ball; see `docs/notation.md`).
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct AssetView {
    /// Address of the JSON Schema of asset files, for editors; otherwise ignored.
    #[serde(rename = "$schema", default, skip_serializing_if = "Option::is_none")]
    pub schema: Option<String>,
    /// Name of the asset: 1 to 128 letters, digits, `-`, `_` or `.`.
    #[schema(pattern = "^[A-Za-z0-9._-]{1,128}$")]
    pub name: String,
    /// Approximate number of samples that the device sends per second.
    #[serde(default = "default_rate")]
    pub sample_rate_hz: f64,
    #[serde(default)]
    pub ball: BallView,
    #[serde(default)]
    pub plate: PlateView,
    /// The contact between ball and plate.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub contact: Option<ContactView>,
    #[serde(default)]
    pub servo: ServoView,
    /// Axes, signs, units and origin of the device's numbers.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub axes: Option<AxesView>,
    /// Settings of the diagnosis.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub diagnostics: Option<DiagnosticsView>,
    /// Learnt parameters, written by a calibration; absent on a rig that is not calibrated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub calibration: Option<CalibrationView>,
    /// Which columns of the rig's files are which quantities, such as
    /// `t_s=time/ms, x_m=ball_x/mm` (the parameter `columns` of an import, `--columns` of the
    /// commands). Used for files that have the columns it names, unless a mapping is given.
    #[schema(max_length = 4096)]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub columns: Option<String>,
}

fn default_rate() -> f64 {
    100.0
}

/// The ball.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields, default)]
pub struct BallView {
    /// Radius, in (0, 1] m.
    #[schema(exclusive_minimum = 0, maximum = 1)]
    pub radius_m: f64,
    /// Mass, in [1e-6, 100] kg.
    #[schema(exclusive_minimum = 0, maximum = 100)]
    pub mass_kg: f64,
    /// κ in the moment of inertia κ m r², in [0, 1]: 0.4 for a solid ball, 0.667 for a
    /// hollow one.
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
    /// Length along x, in (0, 10] m; 0.38 if neither it nor a diameter is given.
    #[schema(exclusive_minimum = 0, maximum = 10)]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub length_m: Option<f64>,
    /// Width along y, in (0, 10] m; 0.24 if neither it nor a diameter is given.
    #[schema(exclusive_minimum = 0, maximum = 10)]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub width_m: Option<f64>,
    /// Diameter of a round plate, in (0, 10] m; excludes length and width.
    #[schema(exclusive_minimum = 0, maximum = 10)]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub diameter_m: Option<f64>,
    /// Thickness, in [0, 1] m.
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

/// The contact between a body and the plate: spring, damper and friction.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ContactView {
    /// Stiffness K, in (0, 1e12] N/m.
    #[schema(exclusive_minimum = 0, maximum = 1e12)]
    pub stiffness_n_per_m: f64,
    /// Damping D, in (0, 1e9] N·s/m.
    #[schema(exclusive_minimum = 0, maximum = 1e9)]
    pub damping_n_s_per_m: f64,
    /// Coefficient of friction μ, in (0, 100].
    #[schema(exclusive_minimum = 0, maximum = 100)]
    pub friction: f64,
    /// Slip speed at and above which friction acts in full, in (0, 10] m/s.
    #[schema(exclusive_minimum = 0, maximum = 10)]
    pub slip_threshold_m_s: f64,
}

impl Default for ContactView {
    fn default() -> Self {
        contact_view(&Contact::default())
    }
}

/// The servos; both have the same parameters.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ServoView {
    /// Largest plate angle, in (0, π/2] rad.
    pub angle_limit_rad: f64,
    /// Time from a command to the first movement, in [0, 5] s.
    #[schema(minimum = 0, maximum = 5)]
    pub dead_time_s: f64,
    /// Time constant of the first-order lag, in [0, 10] s.
    #[schema(minimum = 0, maximum = 10)]
    pub lag_s: f64,
    /// Largest angular rate, in (0, 1000] rad/s.
    #[schema(exclusive_minimum = 0, maximum = 1000)]
    pub rate_limit_rad_s: f64,
}

impl Default for ServoView {
    fn default() -> Self {
        servo_view(&ServoSpec::default())
    }
}

/// Axes, signs, units and origin of the device's numbers, relative to the plate frame.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields, default)]
pub struct AxesView {
    /// Whether the device's x is the plate's y, and its y the plate's x.
    pub swap: bool,
    /// Sign of the readings along the plate's x, 1 or −1.
    pub x_sign: f64,
    /// Sign of the readings along the plate's y, 1 or −1.
    pub y_sign: f64,
    /// Metres per unit of the positions: 0.001 for millimetres.
    pub position_unit_m: f64,
    /// Reading along the plate's x in the middle of the plate (or of the range that end
    /// stops leave), after sign and unit, in [−10, 10] m.
    #[schema(minimum = -10, maximum = 10)]
    pub x_offset_m: f64,
    /// Reading along the plate's y in the middle of the plate (or of the range that end
    /// stops leave), after sign and unit, in [−10, 10] m.
    #[schema(minimum = -10, maximum = 10)]
    pub y_offset_m: f64,
    /// Radians per unit of the commands: 0.01745 for degrees.
    pub command_unit_rad: f64,
}

impl Default for AxesView {
    fn default() -> Self {
        axes_view(&AxisMapping::default())
    }
}

/// Settings of the diagnosis.
#[derive(Clone, Debug, Default, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct DiagnosticsView {
    /// Profile of the diagnosis; `default` if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub profile: Option<ProfileWord>,
    /// Accepted false alarms per rig and year, above 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub false_alarms_per_rig_year: Option<f64>,
    /// Debounce time of all monitors: how long a failure must last before the test fails, in
    /// [0, 60] s.
    #[schema(minimum = 0, maximum = 60)]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub debounce_s: Option<f64>,
}

/// A calibration: the learnt parameters of a rig and the data they come from.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CalibrationView {
    /// Id of the calibration, a hash of its content, given with every fault; ignored on
    /// input.
    #[serde(default)]
    pub id: String,
    /// Time of the calibration, RFC 3339.
    pub made_at: String,
    /// SHA-256 of the data, hexadecimal.
    pub data_sha256: String,
    /// Number of samples of the data.
    pub samples: u64,
    /// Duration of the data, s.
    pub duration_s: f64,
    /// Parameters along x; absent if the rig has no such servo or no such readings.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub x: Option<AxisCalibrationView>,
    /// Parameters along y; absent if the rig has no such servo or no such readings.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub y: Option<AxisCalibrationView>,
    /// Learnt properties of the sensor.
    #[serde(default)]
    pub sensor: SensorCalibrationView,
    /// Estimates of each session by itself, in the order in which the sessions were given.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub sessions: Vec<SessionEstimatesView>,
    /// Test result and expected false alarms of each monitor; empty if the calibration was
    /// not tested.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub certificate: Vec<MonitorCertificateView>,
    /// How soon faults are expected to be found.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub prospects: Option<ProspectsView>,
    /// Moments of the sessions that contradict the rest and were not learnt from.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub left_out: Vec<LeftOutView>,
}

/// A moment that was not learnt from.
#[derive(Clone, Copy, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct LeftOutView {
    /// Number of the session, in the order in which the sessions were given, from 1 on.
    #[schema(minimum = 1)]
    pub session: usize,
    /// Start of the moment on the session's clock, s.
    pub from_s: f64,
    /// End of the moment on the session's clock, s.
    pub to_s: f64,
    /// Why it contradicts the rest.
    pub reason: LeftOutReason,
}

/// Why a moment contradicts the rest of the sessions.
#[derive(Clone, Copy, Debug, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum LeftOutReason {
    /// The readings jumped farther than a ball can move.
    Jumped,
    /// The readings were held or missing, and then jumped.
    Held,
    /// The ball stood where the plate would have moved it.
    Stood,
}

/// Learnt properties of the sensor.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SensorCalibrationView {
    /// Time between two readings of a sensor that is slower than its log, in [0, 10] s; 0
    /// for one that is not.
    #[schema(minimum = 0, maximum = 10)]
    pub refresh_s: f64,
    /// Largest number of recent outliers, each fading with a time constant of ten seconds,
    /// in [0, 1e6].
    #[schema(minimum = 0, maximum = 1e6)]
    pub most_outliers: f64,
    /// Largest scatter about the motion that persisted, in [0, 1] m; 0 if unknown.
    #[schema(minimum = 0, maximum = 1)]
    pub most_scatter_m: f64,
    /// Longest time for which no ball was seen on the plate, in [0, 60] s.
    #[schema(minimum = 0, maximum = 60)]
    pub longest_unseen_s: f64,
}

/// Estimates of one session.
#[derive(Clone, Debug, Default, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SessionEstimatesView {
    /// Estimates along x; absent if the session yields none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub x: Option<SessionEstimateView>,
    /// Estimates along y; absent if the session yields none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub y: Option<SessionEstimateView>,
}

/// Estimates of one session for one axis.
#[derive(Clone, Copy, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SessionEstimateView {
    /// Angle by which plate or servo horn is off level, rad.
    pub level_rad: f64,
    /// Standard error of the level, rad.
    pub level_error_rad: f64,
    /// Measured over modelled acceleration; absent if the ball did not move.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gain: Option<f64>,
    /// Standard error of the gain; absent if the ball did not move.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gain_error: Option<f64>,
}

/// How soon each fault would be confirmed if it occurred during the sessions that the
/// calibration learnt from: the median over trials in which the fault was injected into the
/// readings. Null if fewer than half of the trials confirmed it within 10 s.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ProspectsView {
    /// Number of times at which each fault was injected.
    pub trials: usize,
    /// The x servo; absent if the axis was not calibrated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub x: Option<ServoProspectsView>,
    /// The y servo; absent if the axis was not calibrated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub y: Option<ServoProspectsView>,
    /// Median delay for a ball that sticks, s.
    pub stuck_s: Option<f64>,
    /// Median delay for readings that freeze, s.
    pub frozen_s: Option<f64>,
    /// Median delay for a ball that is not seen, s.
    pub unseen_s: Option<f64>,
}

/// How soon faults of one servo would be confirmed, as in `ProspectsView`.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ServoProspectsView {
    /// Median delay for a servo that does not respond, s.
    pub dead_s: Option<f64>,
    /// Median delay for a servo with half its gain, s.
    pub half_gain_s: Option<f64>,
    /// Median delay for a servo whose horn has slipped by 1°, s.
    pub offset_1deg_s: Option<f64>,
    /// Smallest tried loss of gain that is found, as a fraction of the gain; null if none is.
    pub least_gain_loss: Option<f64>,
    /// Smallest tried slip of the horn that is found, rad; null if none is.
    pub least_offset_rad: Option<f64>,
}

/// Learnt parameters of one axis.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct AxisCalibrationView {
    /// Measured over modelled acceleration, in [−100, 100].
    pub gain: f64,
    /// Time from a command to the servo's first movement, in [0, 5] s.
    pub dead_time_s: f64,
    /// Time constant of the servo's first-order lag, in [0, 10] s.
    pub lag_s: f64,
    /// Angle by which plate or servo horn is off level, the mean over sessions, in
    /// [−1, 1] rad.
    pub level_rad: f64,
    /// Standard deviation of the level from session to session, in [0, 1] rad.
    #[schema(minimum = 0, maximum = 1)]
    #[serde(default = "default_level_spread")]
    pub level_spread_rad: f64,
    /// Standard deviation of the gain from session to session, as a fraction of the gain, in
    /// [0, 10].
    #[schema(minimum = 0, maximum = 10)]
    #[serde(default = "default_gain_spread")]
    pub gain_spread: f64,
    /// Deceleration of a rolling ball, in [0, 10] m/s²; 0 if it was not learnt.
    #[serde(default)]
    pub resistance_m_s2: f64,
    /// Standard deviation of the readings about the fitted motion, in (0, 1] m.
    pub noise_m: f64,
    /// Tilt below which a ball at rest stays at rest, in [0, 1] rad.
    pub breakaway_rad: f64,
    /// Robust standard deviation of the acceleration residual, in (0, 100] m/s².
    pub residual_m_s2: f64,
    /// Acceleration up to which gain and delay were learnt, in [0, 1000] m/s²; absent if
    /// unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub familiar_m_s2: Option<f64>,
    /// Longest time for which healthy readings were bit-identical, in [0, 60] s.
    #[schema(minimum = 0, maximum = 60)]
    #[serde(default = "default_repeat")]
    pub longest_repeat_s: f64,
    /// Longest time for which the ball was seen at rest, in [0, 1e9] s; if 0, the breakaway
    /// angle is unknown.
    #[schema(minimum = 0, maximum = 1e9)]
    #[serde(default)]
    pub rest_s: f64,
    /// Acceleration that the twin does not explain, over half a second, in (0, 100] m/s²;
    /// if absent, it is assumed from the residual.
    #[schema(exclusive_minimum = 0, maximum = 100)]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub model_error_m_s2: Option<f64>,
    /// Largest evidence against the servo while it was healthy, in [0, 1000] nats.
    #[schema(minimum = 0, maximum = 1000)]
    #[serde(default)]
    pub most_nats: f64,
    /// Largest evidence of the path against the servo while it was healthy, in [0, 1000]
    /// nats. If absent, it is unknown, and the path alone does not accuse the servo: calibrate
    /// the rig again.
    #[schema(minimum = 0, maximum = 1000)]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub most_path_nats: Option<f64>,
    /// Of calibrations by earlier versions; not used.
    #[schema(deprecated)]
    #[serde(default, skip_serializing)]
    pub most_path_error_m: Option<f64>,
}

const fn default_level_spread() -> f64 {
    AxisCalibration::POPULATION_LEVEL_SPREAD_RAD
}

const fn default_gain_spread() -> f64 {
    AxisCalibration::POPULATION_GAIN_SPREAD
}

/// Time for which healthy readings may be bit-identical, s.
const fn default_repeat() -> f64 {
    0.15
}

/// Parses and checks an asset file.
///
/// # Errors
/// [`Invalid`] with the JSON pointer of the offending element; the empty
/// pointer stands for the document, with line and column in the reason.
pub fn parse(document: &[u8]) -> Result<Rig, Invalid> {
    json::check_object(document)?;
    rig(&json::parse(document)?)
}

/// Parses an asset file that somebody gives: what has been stored is not refused any more.
///
/// # Errors
/// Those of [`parse`], and [`Invalid`] for a ball that does not fit on its plate.
pub fn parse_new(document: &[u8]) -> Result<Rig, Invalid> {
    let rig = parse(document)?;
    // Of a beam, the width may be smaller than the ball.
    let (longest_m, size) = match rig.plate.shape() {
        PlateShape::Round { diameter_m } => (diameter_m, format!("{diameter_m} m wide")),
        PlateShape::Rectangle { length_m, width_m } => {
            (length_m.max(width_m), format!("{length_m} m x {width_m} m large"))
        }
    };
    let radius_m = rig.ball.radius_m();
    if 2.0 * radius_m < longest_m {
        return Ok(rig);
    }
    let reason = format!("a ball of {} m does not fit on a plate that is {size}", 2.0 * radius_m);
    Err(Invalid::new("/ball/radius_m", reason))
}

/// Returns the rig that a view describes.
///
/// # Errors
/// [`Invalid`] with the JSON pointer of the first invalid element.
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
        calibration: view.calibration.as_ref().map(calibration).transpose()?.map(Box::new),
        columns: view.columns.as_deref().map(columns).transpose()?,
    };
    rig.check()?;
    Ok(rig)
}

fn columns(text: &str) -> Result<Box<str>, Invalid> {
    let mapping = text.parse::<ColumnMapping>();
    mapping.map_err(|error| Invalid::new("/columns", error.to_string()))?;
    Ok(text.into())
}

fn plate(view: &PlateView) -> Result<Plate, Invalid> {
    let shape = plate_shape(view.length_m, view.width_m, view.diameter_m)?;
    Plate::new(shape, view.thickness_m, view.rim)
}

/// Returns the shape with these sizes; missing ones are the chapter's.
pub fn plate_shape(
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

/// Returns the contact that a view describes.
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
    Ok(DiagnosticsSpec {
        profile: view.profile.map(Into::into).unwrap_or_default(),
        false_alarms_per_rig_year: view.false_alarms_per_rig_year,
        debounce_s: view.debounce_s,
    })
}

fn calibration(view: &CalibrationView) -> Result<Calibration, Invalid> {
    let of_axis = |axis: Axis, view: &Option<AxisCalibrationView>| {
        view.as_ref().map(|v| axis_calibration(axis, v)).transpose()
    };
    Ok(Calibration {
        axes: PerAxis { x: of_axis(Axis::X, &view.x)?, y: of_axis(Axis::Y, &view.y)? },
        sensor: sensor_calibration(&view.sensor)?,
        sessions: view.sessions.iter().map(session_estimates).collect(),
        origin: CalibrationOrigin {
            data_sha256: view.data_sha256.clone(),
            made_at: view.made_at.clone(),
        },
        n_samples: view.samples,
        duration_s: view.duration_s,
        certificate: certificate::certificate(&view.certificate)?,
        prospects: view.prospects.as_ref().map(prospects),
        left_out: view.left_out.iter().map(left_out).collect(),
    })
}

fn left_out(view: &LeftOutView) -> LeftOut {
    let reason = match view.reason {
        LeftOutReason::Jumped => Contradiction::Jumped,
        LeftOutReason::Held => Contradiction::Held,
        LeftOutReason::Stood => Contradiction::Stood,
    };
    LeftOut { session: view.session, from_s: view.from_s, to_s: view.to_s, reason }
}

fn left_out_view(moment: &LeftOut) -> LeftOutView {
    let reason = match moment.reason {
        Contradiction::Jumped => LeftOutReason::Jumped,
        Contradiction::Held => LeftOutReason::Held,
        Contradiction::Stood => LeftOutReason::Stood,
    };
    LeftOutView { session: moment.session, from_s: moment.from_s, to_s: moment.to_s, reason }
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
        most_path_nats: view
            .most_path_nats
            .map(|nats| in_range(&at("most_path_nats"), nats, 0.0..=1e3))
            .transpose()?,
        most_nats: in_range(&at("most_nats"), view.most_nats, 0.0..=1e3)?,
    })
}

/// Returns the view of a rig: the content of its asset file.
#[must_use]
pub fn view(rig: &Rig) -> AssetView {
    AssetView {
        schema: None,
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
            profile: Some(rig.diagnostics.profile.into()),
            false_alarms_per_rig_year: rig.diagnostics.false_alarms_per_rig_year,
            debounce_s: rig.diagnostics.debounce_s,
        }),
        calibration: rig.calibration.as_deref().map(calibration_view),
        columns: rig.columns.as_deref().map(str::to_owned),
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

/// Returns the view of a calibration.
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
        most_path_nats: c.most_path_nats,
        most_path_error_m: None,
    };
    CalibrationView {
        id: calibration_id(calibration),
        made_at: calibration.origin.made_at.clone(),
        data_sha256: calibration.origin.data_sha256.clone(),
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
        left_out: calibration.left_out.iter().map(left_out_view).collect(),
    }
}

/// Returns the id of a calibration, which is given with every fault: the first 16
/// hexadecimal digits of the SHA-256 of its parameters and of the hash of its data.
#[must_use]
pub fn calibration_id(calibration: &Calibration) -> String {
    let mut hash = Sha256::new();
    hash.update(calibration.origin.data_sha256.as_bytes());
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
        // Added later: calibrations without it keep their ids.
        if let Some(nats) = learnt.most_path_nats {
            hash.update(nats.to_bits().to_le_bytes());
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
    fn a_file_with_only_a_name_describes_the_chapters_rig() {
        assert_eq!(parse(br#"{"name":"a"}"#).unwrap(), Rig::chapter("a"));
    }

    #[test]
    fn the_address_of_the_schema_is_accepted_and_not_kept() {
        let rig = parse(br#"{"$schema":"asset.schema.json","name":"a"}"#).unwrap();
        assert_eq!(rig, Rig::chapter("a"));
        let error = parse(br#"{"$schema":5,"name":"a"}"#).unwrap_err();
        assert_eq!(error.element, "/$schema");
    }

    #[test]
    fn lengths_in_millimetres_are_named() {
        let plate = r#"{"name":"a","plate":{"length_m":380,"width_m":237}}"#;
        let error = parse(plate.as_bytes()).unwrap_err().to_string();
        let words =
            "/plate/length_m: 380 is not above 0 and at most 10: the unit is m, so 380 mm are 0.38";
        assert_eq!(error, words);
    }

    #[test]
    fn a_ball_that_does_not_fit_on_its_plate_is_refused() {
        let refused = |text: &str| parse_new(text.as_bytes()).unwrap_err().to_string();
        let wide = r#"{"name":"a","ball":{"radius_m":0.712,"mass_kg":0.05,"inertia_factor":0.4}}"#;
        let error = refused(wide);
        assert!(error.contains("/ball/radius_m"), "{error}");
        assert!(
            error.contains("a ball of 1.424 m does not fit on a plate that is 0.38 m"),
            "{error}"
        );
        let round = r#"{"name":"a","ball":{"radius_m":0.06},"plate":{"diameter_m":0.12}}"#;
        assert!(refused(round).contains("0.12 m wide"), "{}", refused(round));
        // What has been stored is still read, and a beam is narrower than its ball.
        assert!(parse(wide.as_bytes()).is_ok());
        let beam =
            r#"{"name":"a","ball":{"radius_m":0.02},"plate":{"length_m":0.5,"width_m":0.03}}"#;
        assert!(parse_new(beam.as_bytes()).is_ok());
    }

    #[test]
    fn a_rig_is_unchanged_after_serialising_and_parsing() {
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
            most_path_nats: Some(3.0),
        };
        let estimate =
            SessionEstimate { level_rad: -0.02, level_error_rad: 1e-3, gain: Some((0.8, 0.02)) };
        let mut rig = Rig::chapter("b");
        rig.plate = Plate::new(PlateShape::Round { diameter_m: 0.3 }, 0.005, false).unwrap();
        rig.mapping.swap = true;
        rig.mapping.origin_m.y = -0.02;
        rig.diagnostics.debounce_s = Some(2.0);
        let calibration = Calibration {
            axes: PerAxis { x: Some(learnt), y: None },
            sensor: SensorCalibration {
                refresh_s: 0.05,
                most_outliers: 2.0,
                most_scatter_m: 1e-3,
                longest_unseen_s: 0.4,
            },
            sessions: vec![PerAxis { x: Some(estimate), y: None }, PerAxis::default()],
            origin: CalibrationOrigin {
                data_sha256: "00".to_owned(),
                made_at: "2026-01-01T00:00:00Z".to_owned(),
            },
            n_samples: 12,
            duration_s: 1.5,
            certificate: Some(std::array::from_fn(|i| MonitorCertificate {
                judged_s: 300.0,
                nearest: 0.25 * i as f64,
                alarms_per_hour: (i > 0).then_some(0.01),
                most_alarms_per_hour: (i > 1).then_some(0.03),
            })),
            left_out: vec![LeftOut {
                session: 2,
                from_s: 30.0,
                to_s: 30.4,
                reason: Contradiction::Held,
            }],
            prospects: Some(Prospects {
                n_trials: 12,
                servos: PerAxis {
                    x: Some(ServoProspects { dead_s: Some(0.5), ..ServoProspects::default() }),
                    y: None,
                },
                stuck_s: Some(1.5),
                ..Prospects::default()
            }),
        };
        rig.calibration = Some(Box::new(calibration));
        let json = serde_json::to_vec(&view(&rig)).unwrap();
        assert_eq!(parse(&json).unwrap(), rig);
    }

    #[test]
    fn an_error_names_the_invalid_element_and_the_reason() {
        let cases = [
            (r#"{"name":"a","ball":{"radius_m":-1}}"#, "/ball/radius_m", "not above 0"),
            (r#"{"name":"a","ball":{"radius_m":"x"}}"#, "/ball/radius_m", "not a number"),
            (r#"{"name":"a","bal":{}}"#, "/bal", "not known"),
            (r#"{"name":"a b"}"#, "/name", "A-Z"),
            (r#"{"ball":{}}"#, "/name", "is missing"),
            (r#"{"name":"a","plate":{"diameter_m":1,"width_m":1}}"#, "/plate/diameter_m", "round"),
            (r#"{"name":"a","axes":{"x_sign":2}}"#, "/axes/x_sign", "neither"),
            (r#"{"name":"a","axes":{"y_offset_m":20}}"#, "/axes/y_offset_m", "outside"),
            (r#"{"name":"a","diagnostics":{"profile":"best"}}"#, "/diagnostics/profile", "best"),
            (r#"{"name":"a","servo":{"lag_s":-0.1}}"#, "/servo/lag_s", "outside"),
            (r#"{"name":"a","sample_rate_hz":1e999}"#, "/sample_rate_hz", "too large"),
            (r#"{"name":"a"} x"#, "", "column 14"),
        ];
        for (document, element, reason) in cases {
            let error = parse(document.as_bytes()).unwrap_err();
            assert_eq!(error.element, element, "{document}: {error}");
            assert!(error.reason.contains(reason), "{document}: {error}");
        }
    }
}
