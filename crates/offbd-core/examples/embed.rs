//! Runs the twin and the diagnosis inside a program of your own, without the service:
//! `cargo run -p offbd-core --example embed`.
//!
//! The "device" is a closure that simulates the rig with the library's own twin; its x
//! servo stops answering after ten seconds.

use offbd_core::diagnosis::FaultMemory;
use offbd_core::engine::{Engine, Input, Rig, Setup};
use offbd_core::plant::{RollingState, Twin};
use offbd_core::vocabulary::{Invalid, PerAxis, Sample, SimTime};

fn main() -> Result<(), Invalid> {
    let setup = Setup::new(Rig::chapter("my-rig"), None)?;
    let mut plant = Twin::new(setup.twin);
    let mut device = |t_s: f64| -> Option<Sample> {
        let (ball, wave) = (*plant.motion(), 0.03 * (2.0 * t_s).sin());
        let pd = |wanted: f64, x: f64, v: f64| (0.8 * (wanted - x) - 0.5 * v).clamp(-0.2, 0.2);
        let cmd_qy = pd(wave, ball.position.x, ball.velocity.x);
        let cmd_qx = -pd(-wave, ball.position.y, ball.velocity.y);
        let obeyed = PerAxis { x: Some(if t_s < 10.0 { cmd_qy } else { 0.0 }), y: Some(cmd_qx) };
        plant.advance(SimTime::new(t_s)?, obeyed, &RollingState::default());
        let (cmd_qx_rad, cmd_qy_rad) = (Some(cmd_qx), Some(cmd_qy));
        let (x_m, y_m) = (Some(ball.position.x), Some(ball.position.y));
        Some(Sample { seq: None, t_s, cmd_qx_rad, cmd_qy_rad, x_m, y_m })
    };
    let mut engine = Engine::new(setup, FaultMemory::default());
    let mut transitions = Vec::new();
    for sample in (0..2000).map_while(|i| device(f64::from(i) * 0.01)) {
        engine.handle(Input::Sample(sample), &mut transitions);
        for fault in transitions.drain(..) {
            println!("{:.2} s: {} is {}", fault.at.seconds(), fault.code, fault.status);
        }
    }
    Ok(())
}
