//! Compares what is stored with what devices and persons were told.

use std::collections::BTreeMap;
use std::ops::ControlFlow;

use super::device::{Content, Device, content};
use super::world::{RUNTIME, World};
use crate::playback::play;
use crate::{ServiceError, views};
use offbd_core::engine::{Input, Setup};
use offbd_core::vocabulary::{FaultCode, Sample};
use offbd_store::{SessionFilter, SessionRow};
use offbd_wire::judging::Judging;

/// Checks all sessions, which have ended, and all actions.
///
/// # Errors
/// The first thing that is wrong.
pub(super) fn check(world: &World) -> Result<(), String> {
    for device in &world.devices {
        let sessions = sessions(world, &device.asset)?;
        check_samples(world, device, &sessions)?;
        for session in &sessions {
            check_verdict(world, session).map_err(|error| format!("{}: {error}", session.name))?;
        }
    }
    check_actions(world)
}

pub(super) fn sessions(world: &World, asset: &str) -> Result<Vec<SessionRow>, String> {
    let filter = SessionFilter { asset: Some(asset.to_owned()), ..SessionFilter::default() };
    let rows = RUNTIME.block_on(world.inner().handles.store.sessions(&filter, 10_000));
    rows.map_err(|error| error.to_string())
}

/// Returns the recording of `session`.
pub(super) fn recorded(world: &World, session: &SessionRow) -> Result<Vec<Sample>, String> {
    let mut recording = world.inner().handles.store.recording(session, 0);
    let mut all = Vec::new();
    while let Some(samples) =
        RUNTIME.block_on(recording.next()).map_err(|error| error.to_string())?
    {
        all.extend(samples);
    }
    Ok(all)
}

/// All that was acknowledged is there, unless it was deleted; everything is there once, as it
/// was measured, and in the session that the device has named.
fn check_samples(world: &World, device: &Device, sessions: &[SessionRow]) -> Result<(), String> {
    let mut found: BTreeMap<Content, &str> = BTreeMap::new();
    for session in sessions {
        for sample in recorded(world, session)? {
            let key = content(&sample);
            let at = || format!("{} {key:?} in `{}`", device.asset, session.name);
            if device.measured.get(&key) != Some(&sample) {
                return Err(format!("{}: not as measured: {sample:?}", at()));
            }
            if let Some(before) = found.insert(key, &session.name) {
                return Err(format!("{}: also in `{before}`", at()));
            }
            if device.session(key.0).is_some_and(|name| !is_part_of(&session.name, &name)) {
                return Err(format!("{}: in the wrong session", at()));
            }
        }
    }
    let is_lost = |key: &&Content| !found.contains_key(key) && !device.deleted.contains(key);
    let lost: Vec<_> = device.acknowledged.iter().filter(is_lost).collect();
    if lost.is_empty() {
        return Ok(());
    }
    let describe = |row: &SessionRow| format!("`{}` {} {:?}", row.name, row.state, row.progress);
    let sessions: Vec<_> = sessions.iter().map(describe).collect();
    Err(format!("{}: lost {lost:?} of {sessions:?}", device.asset))
}

/// Whether `name` is that of a part of the session `first`.
fn is_part_of(name: &str, first: &str) -> bool {
    let rest = name.strip_prefix(first);
    rest.is_some_and(|rest| rest.is_empty() || rest.starts_with(" ("))
}

/// The verdict is that of the recording.
fn check_verdict(world: &World, session: &SessionRow) -> Result<(), String> {
    let text = |error: ServiceError| error.to_string();
    let setup = views::rig(&session.setup).and_then(|rig| Ok(Setup::new(rig, None)?));
    let baseline = views::memory(&session.baseline).map_err(text)?;
    let mut judging = Judging::new(setup.map_err(text)?, baseline);
    let mut n_transitions = 0;
    let handles = &world.inner().handles;
    let mut take = |judging: &mut Judging, input| {
        judging.input(input);
        n_transitions += judging.transitions().len() as i64;
    };
    play(handles, session, 0, |input| {
        take(&mut judging, input);
        ControlFlow::Continue(())
    })
    .map_err(text)?;
    take(&mut judging, Input::End);
    let n_rejected = u64::try_from(session.progress.n_rejected).unwrap_or_default();
    let hash = judging.summary(&session.name, n_rejected).verdict_hash;
    if session.verdict_hash.as_ref() != Some(&hash) {
        return Err(format!("verdict {:?} instead of {hash}", session.verdict_hash));
    }
    let stored = RUNTIME.block_on(handles.store.n_transitions(&session.id));
    match stored.map_err(|error| error.to_string())? {
        stored if stored == n_transitions => Ok(()),
        stored => Err(format!("{stored} transitions instead of {n_transitions}")),
    }
}

/// What persons were told to be done is recorded once.
fn check_actions(world: &World) -> Result<(), String> {
    let mut actors = Vec::new();
    for device in &world.devices {
        let code = FaultCode::XServo.as_str();
        let actions =
            world.inner().handles.store.actions_before(&device.asset, code, i64::MAX, 10_000);
        let actions = RUNTIME.block_on(actions).map_err(|error| error.to_string())?;
        actors.extend(actions.into_iter().map(|row| row.actor));
    }
    for actor in &world.confirmed {
        match actors.iter().filter(|found| *found == actor).count() {
            1 => {}
            n => return Err(format!("the act of {actor} is recorded {n} times")),
        }
    }
    Ok(())
}
