//! Application 3: a rig and its twin, judged by the chapter's rule.

mod ideal_rig;
mod plot;

use serde_json::json;

use super::SceneArgs;
use super::files::OutputFolder;
use super::report::row;
use ideal_rig::{ProfileVerdict, ReportedFault, judge, record};
use offbd_core::diagnosis::Profile;
use offbd_terminal::errors::BadArgument;
use offbd_terminal::output::{self, OutputFormat};
use offbd_terminal::table;

/// Runs the healthy rig, or the one with a bad x servo.
pub(super) fn run(args: &SceneArgs, bad_x: bool) -> anyhow::Result<()> {
    let name = if bad_x { "bad-x-servo" } else { "good-asset" };
    if !args.how.is_plain() || args.sample.is_some() {
        let text = format!(
            "{name} is a rig with its own twin: \
             --model, --method, --step, --tolerance and --sample do not apply"
        );
        return Err(BadArgument(text).into());
    }
    let recording = record(bad_x)?;
    let judged: Vec<ProfileVerdict> = [Profile::Textbook, Profile::Default]
        .into_iter()
        .map(|profile| judge(&recording, profile))
        .collect::<Result<_, _>>()?;
    if let Some(folder) = OutputFolder::new(args.output.as_deref())? {
        folder.trajectory("trajectory.csv", &recording.truth)?;
        folder.session(&recording.samples)?;
        folder.asset(&recording.rig)?;
        folder.figure("deviation", &plot::deviation(name, &judged[0]))?;
    }
    show(args.format, name, &judged)
}

fn show(format: OutputFormat, name: &str, judged: &[ProfileVerdict]) -> anyhow::Result<()> {
    match format {
        OutputFormat::Table => output::print_line(&lines(name, judged).join("\n")),
        OutputFormat::Json => {
            let view = |fault: &ReportedFault| json!({ "code": fault.code.to_string(), "kind": fault.kind, "t_s": fault.t_s });
            let list = |faults: &[ReportedFault]| faults.iter().map(view).collect::<Vec<_>>();
            let verdicts = judged.iter().map(|judged| {
                json!({
                    "profile": judged.profile.as_str(),
                    "faults": list(&judged.faults),
                    "pending": list(&judged.pending),
                })
            });
            let verdicts: Vec<_> = verdicts.collect();
            output::print_line(&json!({ "scene": name, "verdicts": verdicts }).to_string())
        }
    }
}

fn lines(name: &str, judged: &[ProfileVerdict]) -> Vec<String> {
    let what = if name == "bad-x-servo" {
        "its x servo obeys 0.5 s late; x_servo is to be reported, and nothing else"
    } else {
        "nothing is to be reported"
    };
    let mut lines = vec![
        row("scene", &format!("{name}, {} s", ideal_rig::DURATION_S)),
        row(
            "rig",
            &format!(
                "the default rig without noise, on a plate of 1 m (its models have no edge), in \
                 closed loop beside its twin; {what}"
            ),
        ),
        String::new(),
    ];
    let mut rows = table::table(&["profile", "reports", "largest deviation x, y"], &[]);
    for one in judged {
        let [x, y] = one.largest();
        rows.add_row([
            one.profile.as_str().to_owned(),
            one.words(),
            format!("{x:.1e}, {y:.1e} m/s²"),
        ]);
    }
    lines.extend(table::lines(&rows));
    lines
}
