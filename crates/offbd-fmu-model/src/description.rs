//! The model description and the documentation of an FMU.

use std::fmt::Write;

use offbd_core::engine::Setup;
use offbd_core::vocabulary::Invalid;

use crate::MODEL_IDENTIFIER;
use crate::start_values::StartValues;
use crate::variables::{Role, VARIABLES, Variable};
use crate::version::FmiVersion;

/// The licences of the model; their texts are in the FMU.
const LICENSE: &str = env!("CARGO_PKG_LICENSE");

/// The units, each with its exponents of base units, and the unit in which it is shown.
const UNITS: &str = r#"  <UnitDefinitions>
    <Unit name="s"><BaseUnit s="1"/></Unit>
    <Unit name="m"><BaseUnit m="1"/><DisplayUnit name="mm" factor="1000"/></Unit>
    <Unit name="m/s"><BaseUnit m="1" s="-1"/><DisplayUnit name="mm/s" factor="1000"/></Unit>
    <Unit name="m/s2"><BaseUnit m="1" s="-2"/></Unit>
    <Unit name="rad"><BaseUnit rad="1"/><DisplayUnit name="deg" factor="57.29577951308232"/></Unit>
    <Unit name="rad/s"><BaseUnit rad="1" s="-1"/><DisplayUnit name="deg/s" factor="57.29577951308232"/></Unit>
  </UnitDefinitions>
"#;

/// Returns the `modelDescription.xml` of the twin of `setup`, a rig whose name is checked.
///
/// # Errors
/// [`Invalid`] naming a variable, if the rig has a value that the model does not take.
pub fn model_description(setup: &Setup, version: FmiVersion) -> Result<String, Invalid> {
    let values = StartValues::of(setup)?;
    let mut xml = head(setup, version);
    xml.push_str("  <ModelVariables>\n");
    for (reference, variable) in described(version) {
        xml.push_str(&element(version, reference, variable, values.values()[reference]));
    }
    xml.push_str("  </ModelVariables>\n  <ModelStructure>\n");
    write_unknowns(&mut xml, version, "Output", |role| matches!(role, Role::State | Role::Output));
    write_unknowns(&mut xml, version, "InitialUnknown", |role| role == Role::Output);
    xml.push_str("  </ModelStructure>\n</fmiModelDescription>\n");
    Ok(xml)
}

/// Returns what is before the variables.
fn head(setup: &Setup, version: FmiVersion) -> String {
    let (token, states, serialize) = match version {
        FmiVersion::V2 => ("guid", "canGetAndSetFMUstate", "canSerializeFMUstate"),
        FmiVersion::V3 => ("instantiationToken", "canGetAndSetFMUState", "canSerializeFMUState"),
    };
    format!(
        r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="{version}" modelName="{name}" {token}="{own}" description="Digital twin of a ball on a plate" version="{offbd}" license="{LICENSE}" generationTool="offbd {offbd}" variableNamingConvention="structured">
  <CoSimulation modelIdentifier="{MODEL_IDENTIFIER}" canHandleVariableCommunicationStepSize="true" {states}="true" {serialize}="true"/>
{UNITS}  <LogCategories>
    <Category name="logStatusError" description="Why a call is refused"/>
  </LogCategories>
  <DefaultExperiment startTime="0" stopTime="10" stepSize="{step}"/>
"#,
        name = setup.rig.name,
        own = instantiation_token(),
        offbd = env!("CARGO_PKG_VERSION"),
        step = 1.0 / setup.rig.sample_rate_hz,
    )
}

/// Returns the variables of a model description, with their references. FMI 2.0 needs no variable
/// of the time, and the FMI Library, by which many of its importers read an FMU, reports one
/// without a start value as an error, though the standard forbids the value.
fn described(version: FmiVersion) -> impl Iterator<Item = (usize, &'static Variable)> {
    let is_described = move |v: &Variable| version == FmiVersion::V3 || v.role != Role::Time;
    VARIABLES.iter().enumerate().filter(move |(_, variable)| is_described(variable))
}

/// Returns the element of a variable.
fn element(version: FmiVersion, reference: usize, variable: &Variable, start: f64) -> String {
    let Variable { name, role, description, .. } = variable;
    let (attributes, number) = (attributes(*role), number(variable, start));
    let common =
        format!(r#"name="{name}" valueReference="{reference}" description="{description}""#);
    match version {
        FmiVersion::V2 => {
            format!("    <ScalarVariable {common} {attributes}><Real{number}/></ScalarVariable>\n")
        }
        FmiVersion::V3 => format!("    <Float64 {common} {attributes}{number}/>\n"),
    }
}

/// Returns the unit, the range and the start value of a variable, as far as it has them.
fn number(Variable { role, unit, range, .. }: &Variable, start: f64) -> String {
    let mut attributes = String::new();
    if !unit.is_empty() {
        let _ = write!(attributes, r#" unit="{unit}""#);
    }
    if matches!(role, Role::Input | Role::FixedParameter | Role::TunableParameter) {
        let _ = write!(attributes, r#" min="{}" max="{}""#, range.start(), range.end());
    }
    if !matches!(role, Role::Time | Role::Output) {
        let _ = write!(attributes, r#" start="{start}""#);
    }
    attributes
}

const fn attributes(role: Role) -> &'static str {
    match role {
        Role::Time => r#"causality="independent" variability="continuous""#,
        Role::Input => r#"causality="input""#,
        Role::State => r#"causality="output" initial="exact""#,
        Role::Output => r#"causality="output" initial="calculated""#,
        Role::FixedParameter => r#"causality="parameter" variability="fixed""#,
        Role::TunableParameter => r#"causality="parameter" variability="tunable""#,
        Role::Constant => r#"causality="local" variability="constant""#,
    }
}

/// Writes the elements of one kind of the structure of the model: FMI 2.0 puts them into a list,
/// and counts the variables from 1.
fn write_unknowns(
    xml: &mut String,
    version: FmiVersion,
    kind: &str,
    wanted: impl Fn(Role) -> bool,
) {
    let of_kind = described(version).enumerate().filter(|(_, (_, v))| wanted(v.role));
    match version {
        FmiVersion::V2 => {
            let unknown = |(i, _)| format!("      <Unknown index=\"{}\"/>\n", i + 1);
            let list: String = of_kind.map(unknown).collect();
            let _ = writeln!(xml, "    <{kind}s>\n{list}    </{kind}s>");
        }
        FmiVersion::V3 => of_kind.for_each(|(_, (reference, _))| {
            let _ = writeln!(xml, r#"    <{kind} valueReference="{reference}"/>"#);
        }),
    }
}

/// Returns the token that ties a library to its model description: it changes with the list of
/// variables.
#[must_use]
pub fn instantiation_token() -> String {
    let text = VARIABLES.iter().flat_map(|v| [v.name, attributes(v.role), v.unit, "\n"]);
    // FNV-1a.
    let hash = text.flat_map(str::bytes).fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    });
    format!("offbd-{}-{hash:016x}", env!("CARGO_PKG_VERSION"))
}

/// Returns the page that explains the model of `setup`, in HTML.
///
/// # Errors
/// [`Invalid`] naming a variable, if the rig has a value that the model does not take.
pub fn documentation(setup: &Setup, version: FmiVersion) -> Result<String, Invalid> {
    let values = StartValues::of(setup)?;
    let mut html = format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<meta charset=\"utf-8\">\n\
         <title>{name}</title>\n<h1>{name}: digital twin of a ball on a plate</h1>\n\
         <p>Co-simulation by FMI {version}. The commands hold from the begin of a communication step. \
         Each servo has a dead time, a lag, a rate limit and an angle limit, and is solved \
         exactly; at the start both stand on their commands. The ball rolls, or slides where \
         friction cannot hold it; the plate has no edge, and the mass of the ball has no effect. \
         A positive qy moves the ball toward +x, a positive qx toward &minus;y. All values are \
         in SI units. There is no clock and no random number: equal inputs give equal \
         outputs. Communication steps should be 1 ms or longer: in shorter ones the effect of the \
         plate&rsquo;s rates on the ball is underestimated. If a dead time is a multiple of the \
         step, rounding of the importer&rsquo;s times decides whether a servo begins to turn at the \
         end of a step or at the start of the next, and the path differs by that step.</p>\n\
         <p>A tunable parameter can also be set between two steps, to inject a fault; it holds \
         from the next step on. A fixed parameter holds for the whole simulation. A servo without \
         power has the command gain 0, one that is stuck the least rate limit, one whose horn has \
         slipped another level, a slow one a longer lag and a lower rate limit.</p>\n\
         <table>\n<tr><th>variable<th>kind<th>unit<th>start<th>what it is\n",
        name = setup.rig.name,
    );
    for (variable, start) in VARIABLES.iter().zip(values.values()) {
        let Variable { name, role, unit, description, .. } = variable;
        let kind = kind(*role);
        let _ = writeln!(html, "<tr><td>{name}<td>{kind}<td>{unit}<td>{start}<td>{description}");
    }
    html.push_str("</table>\n</html>\n");
    Ok(html)
}

const fn kind(role: Role) -> &'static str {
    match role {
        Role::Time => "time",
        Role::Input => "input",
        Role::State => "output, set at the start",
        Role::Output => "output",
        Role::FixedParameter => "fixed parameter",
        Role::TunableParameter => "tunable parameter",
        Role::Constant => "constant",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use offbd_core::engine::Rig;

    #[test]
    fn every_unit_is_defined_and_no_text_needs_an_escape() {
        for variable in &VARIABLES {
            let unit = format!("<Unit name=\"{}\">", variable.unit);
            assert!(variable.unit.is_empty() || UNITS.contains(&unit), "{}", variable.name);
            assert!(!variable.description.contains(['<', '>', '&', '"']), "{}", variable.name);
        }
    }

    #[test]
    fn a_parameter_of_the_rig_is_a_start_value() {
        let mut rig = Rig::chapter("lab-3");
        rig.servo.lag_s = 0.085;
        let setup = Setup::new(rig, None).unwrap();
        for version in FmiVersion::ALL {
            let xml = model_description(&setup, version).unwrap();
            assert!(xml.contains(r#"modelName="lab-3""#));
            let lag = xml.lines().find(|line| line.contains(r#""y_servo.lag""#)).unwrap();
            assert!(lag.contains(r#"unit="s" min="0" max="10" start="0.085""#), "{lag}");
        }
    }
}
