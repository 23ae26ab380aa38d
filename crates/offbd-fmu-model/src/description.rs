//! The model description and the documentation of an FMU.

use std::fmt::Write;

use offbd_core::engine::Setup;
use offbd_core::vocabulary::Invalid;

use crate::MODEL_IDENTIFIER;
use crate::start_values::StartValues;
use crate::variables::{Role, VARIABLES, Variable};

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
pub fn model_description(setup: &Setup) -> Result<String, Invalid> {
    let values = StartValues::of(setup)?;
    let (name, version, token) =
        (&setup.rig.name, env!("CARGO_PKG_VERSION"), instantiation_token());
    let mut xml = format!(
        r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="{name}" instantiationToken="{token}" description="Digital twin of a ball on a plate" version="{version}" generationTool="offbd {version}" variableNamingConvention="structured">
  <CoSimulation modelIdentifier="{MODEL_IDENTIFIER}" canHandleVariableCommunicationStepSize="true" canGetAndSetFMUState="true" canSerializeFMUState="true"/>
{UNITS}  <LogCategories>
    <Category name="logStatusError" description="Why a call is refused"/>
  </LogCategories>
  <DefaultExperiment startTime="0" stopTime="10" stepSize="{step}"/>
  <ModelVariables>
"#,
        step = 1.0 / setup.rig.sample_rate_hz,
    );
    for (reference, variable) in VARIABLES.iter().enumerate() {
        write_variable(&mut xml, reference, variable, values.values()[reference]);
    }
    xml.push_str("  </ModelVariables>\n  <ModelStructure>\n");
    write_references(&mut xml, "Output", |role| matches!(role, Role::State | Role::Output));
    write_references(&mut xml, "InitialUnknown", |role| role == Role::Output);
    xml.push_str("  </ModelStructure>\n</fmiModelDescription>\n");
    Ok(xml)
}

fn write_variable(xml: &mut String, reference: usize, variable: &Variable, start: f64) {
    let Variable { name, role, unit, description, range } = variable;
    let _ = write!(
        xml,
        r#"    <Float64 name="{name}" valueReference="{reference}" description="{description}" {}"#,
        attributes(*role)
    );
    if !unit.is_empty() {
        let _ = write!(xml, r#" unit="{unit}""#);
    }
    if matches!(role, Role::Input | Role::Parameter) {
        let _ = write!(xml, r#" min="{}" max="{}""#, range.start(), range.end());
    }
    if !matches!(role, Role::Time | Role::Output) {
        let _ = write!(xml, r#" start="{start}""#);
    }
    xml.push_str("/>\n");
}

const fn attributes(role: Role) -> &'static str {
    match role {
        Role::Time => r#"causality="independent" variability="continuous""#,
        Role::Input => r#"causality="input""#,
        Role::State => r#"causality="output" initial="exact""#,
        Role::Output => r#"causality="output" initial="calculated""#,
        Role::Parameter => r#"causality="parameter" variability="fixed""#,
        Role::Constant => r#"causality="local" variability="constant""#,
    }
}

fn write_references(xml: &mut String, element: &str, wanted: impl Fn(Role) -> bool) {
    for (reference, _) in VARIABLES.iter().enumerate().filter(|(_, v)| wanted(v.role)) {
        let _ = writeln!(xml, r#"    <{element} valueReference="{reference}"/>"#);
    }
}

/// Returns the token that ties a library to its model description: another list of variables
/// has another one.
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
pub fn documentation(setup: &Setup) -> Result<String, Invalid> {
    let values = StartValues::of(setup)?;
    let mut html = format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<meta charset=\"utf-8\">\n\
         <title>{name}</title>\n<h1>{name}: digital twin of a ball on a plate</h1>\n\
         <p>Co-simulation by FMI 3.0. The commands hold from the begin of a communication step. \
         Each servo has a dead time, a lag, a rate limit and an angle limit, and is solved \
         exactly; at the start both stand on their commands. The ball rolls, or slides where \
         friction cannot hold it; the plate has no edge, and the mass of the ball has no effect. \
         A positive qy moves the ball toward +x, a positive qx toward &minus;y. All values are \
         in SI units. There is no clock and no random number: equal inputs give equal \
         outputs. Communication steps should be 1 ms or longer: in shorter ones the effect of the \
         plate&rsquo;s rates on the ball is underestimated. If a dead time is a multiple of the \
         step, rounding of the importer&rsquo;s times decides whether a servo begins to turn at the \
         end of a step or at the start of the next, and the path differs by that step.</p>\n<table>\n<tr><th>variable<th>unit<th>start<th>what it is\n",
        name = setup.rig.name,
    );
    for (variable, start) in VARIABLES.iter().zip(values.values()) {
        let Variable { name, unit, description, .. } = variable;
        let _ = writeln!(html, "<tr><td>{name}<td>{unit}<td>{start}<td>{description}");
    }
    html.push_str("</table>\n</html>\n");
    Ok(html)
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
        let xml = model_description(&Setup::new(rig, None).unwrap()).unwrap();
        assert!(xml.contains(r#"modelName="lab-3""#));
        let lag = xml.lines().find(|line| line.contains(r#""y_servo.lag""#)).unwrap();
        assert!(lag.contains(r#"unit="s" min="0" max="10" start="0.085""#), "{lag}");
    }
}
