//! The named scenes, and scene files.

use std::path::Path;

use serde_json::json;

use offbd_core::vocabulary::Invalid;
use offbd_scene_file::{NamedScene, parse};
use offbd_terminal::errors::{BadArgument, InputError, read};
use offbd_terminal::output::{self, OutputFormat};
use offbd_terminal::table;

/// What to run.
pub(super) enum Exercise {
    /// Scenes whose plate moves by a law of time: the requested one, and others to compare
    /// it with.
    Laws {
        scenes: Vec<NamedScene>,
        /// Accuracy required by the purpose of the scene, m, if any.
        tolerance_m: Option<f64>,
    },
    /// The plate in closed loop, with or without the impulse.
    Control { impulse: bool },
    /// A simulated rig with its twin, with or without the bad x servo.
    Rig { bad_x: bool },
}

struct CatalogueEntry {
    name: &'static str,
    about: &'static str,
    what: EntryContent,
}

enum EntryContent {
    /// Scene files.
    Laws(&'static [&'static str]),
    /// Scene files, with the accuracy required by their purpose, m.
    Fine(f64, &'static [&'static str]),
    Control(bool),
    Rig(bool),
}

macro_rules! file {
    ($name:literal) => {
        include_str!(concat!("../../scenes/", $name, ".json"))
    };
}

const ENTRIES: [CatalogueEntry; 12] = [
    CatalogueEntry {
        name: "tilt",
        about: "the plate tilts by pi/20 on both axes; the ball rolls off and falls",
        what: EntryContent::Laws(&[file!("tilt")]),
    },
    CatalogueEntry {
        name: "pid",
        about: "two PID loops every 10 ms bring the ball to the centre, 30 s",
        what: EntryContent::Control(false),
    },
    CatalogueEntry {
        name: "pid-impulse",
        about: "the same, and at 10 s a push of 10 % of the ball's weight along x for 0.1 s",
        what: EntryContent::Control(true),
    },
    CatalogueEntry {
        name: "block",
        about: "tilt with a cube beside the ball, which friction holds",
        what: EntryContent::Fine(1e-7, &[file!("block"), file!("tilt")]),
    },
    CatalogueEntry {
        name: "good-asset",
        about: "a rig and its twin side by side; nothing is reported",
        what: EntryContent::Rig(false),
    },
    CatalogueEntry {
        name: "bad-x-servo",
        about: "the same, but its x servo obeys 0.5 s late; x_servo is reported",
        what: EntryContent::Rig(true),
    },
    CatalogueEntry {
        name: "slope",
        about: "both angles pi/20 on an endless plate, 0.4 s",
        what: EntryContent::Laws(&[file!("slope")]),
    },
    CatalogueEntry {
        name: "sine",
        about: "both angles swing by 0.05 rad at 0.7 and 0.9 Hz, 10 s",
        what: EntryContent::Laws(&[file!("sine")]),
    },
    CatalogueEntry {
        name: "steep",
        about: "qy turns to 1.2 rad within 0.15 s: the ball slips, 0.4 s",
        what: EntryContent::Laws(&[file!("steep")]),
    },
    CatalogueEntry {
        name: "slope-soft",
        about: "slope on the soft contact of section 4.8",
        what: EntryContent::Laws(&[file!("slope-soft")]),
    },
    CatalogueEntry {
        name: "sine-soft",
        about: "sine on the soft contact",
        what: EntryContent::Laws(&[file!("sine-soft")]),
    },
    CatalogueEntry {
        name: "steep-soft",
        about: "steep on the soft contact",
        what: EntryContent::Laws(&[file!("steep-soft")]),
    },
];

/// Prints one line per named scene.
pub(super) fn list(format: OutputFormat) -> anyhow::Result<()> {
    if format == OutputFormat::Json {
        let line = |entry: &CatalogueEntry| json!({ "scene": entry.name, "about": entry.about });
        return ENTRIES.iter().try_for_each(|entry| output::print_json(&line(entry)));
    }
    let mut rows = table::table(&["scene", "what happens"], &[]);
    for entry in &ENTRIES {
        rows.add_row([entry.name, entry.about]);
    }
    output::print_line(&table::lines(&rows).collect::<Vec<_>>().join("\n"))
}

/// Returns the scene of this name, or that of the file.
pub(super) fn find(word: &str) -> anyhow::Result<Exercise> {
    if let Some(entry) = ENTRIES.iter().find(|entry| entry.name == word) {
        return Ok(match entry.what {
            EntryContent::Laws(files) => {
                Exercise::Laws { scenes: parsed(files)?, tolerance_m: None }
            }
            EntryContent::Fine(tolerance, files) => {
                Exercise::Laws { scenes: parsed(files)?, tolerance_m: Some(tolerance) }
            }
            EntryContent::Control(impulse) => Exercise::Control { impulse },
            EntryContent::Rig(bad_x) => Exercise::Rig { bad_x },
        });
    }
    let path = Path::new(word);
    let looks_like_a_file = path.extension().is_some() || path.components().count() > 1;
    if !looks_like_a_file && !path.exists() {
        let names = ENTRIES.map(|entry| entry.name).join(", ");
        let text = format!("no scene is called {word}; expected a scene file or one of {names}");
        return Err(BadArgument(text).into());
    }
    let scene = parse(&read(path)?).map_err(|e| InputError::file(path, e))?;
    Ok(Exercise::Laws { scenes: vec![scene], tolerance_m: None })
}

fn parsed(files: &[&str]) -> Result<Vec<NamedScene>, Invalid> {
    files.iter().map(|text| parse(text.as_bytes())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_named_scene_can_be_found_and_has_its_files_name() {
        for entry in &ENTRIES {
            if let Exercise::Laws { scenes, .. } = find(entry.name).unwrap() {
                assert_eq!(scenes[0].name, entry.name);
            }
            assert!(entry.name.len() + entry.about.len() < 160, "{}", entry.name);
        }
    }
}
