//! The twin and the diagnosis on a microcontroller: diagnoses twenty seconds of a rig whose x
//! servo fails after ten, on a Cortex-M4F without an operating system. `cargo run --release`
//! in this directory runs it in QEMU (`qemu-system-arm`).
//!
//! The rig is simulated with the library's twin, as in
//! `crates/offbd-core/examples/embed.rs`; on a real board, commands and readings come from
//! the controller and a sensor.

#![no_std]
#![no_main]

extern crate alloc;

use core::mem::MaybeUninit;
use core::ptr::addr_of_mut;

use cortex_m_rt::entry;
use cortex_m_semihosting::{debug, hprintln};
use embedded_alloc::LlffHeap;
use offbd_core::diagnosis::FaultMemory;
use offbd_core::engine::{Engine, Input, Rig, Setup};
use offbd_core::maths::sine::sin_cos;
use offbd_core::plant::{RollingState, Twin};
use offbd_core::vocabulary::{Invalid, PerAxis, Sample, SimTime};
use panic_semihosting as _;

#[global_allocator]
static HEAP: LlffHeap = LlffHeap::empty();

/// An engine needs about 13 KiB; the rest is for the evidence of faults.
const HEAP_BYTES: usize = 48 * 1024;

#[entry]
fn main() -> ! {
    static mut MEMORY: [MaybeUninit<u8>; HEAP_BYTES] = [MaybeUninit::uninit(); HEAP_BYTES];
    // SAFETY: called once, before any allocation; nothing else uses the array.
    unsafe { HEAP.init(addr_of_mut!(*MEMORY) as usize, HEAP_BYTES) }
    let result = judge();
    if let Err(invalid) = &result {
        hprintln!("{}", invalid);
    }
    debug::exit(if result.is_ok() { debug::EXIT_SUCCESS } else { debug::EXIT_FAILURE });
    loop {}
}

fn judge() -> Result<(), Invalid> {
    let setup = Setup::new(Rig::chapter("my-rig"), None)?;
    let mut plant = Twin::new(setup.twin);
    let mut engine = Engine::new(setup, FaultMemory::default());
    let mut transitions = alloc::vec::Vec::new();
    for sample in (0..2000).map_while(|i| sample(&mut plant, f64::from(i) * 0.01)) {
        engine.handle(Input::Sample(sample), &mut transitions);
        for fault in transitions.drain(..) {
            hprintln!("{:.2} s: {} is {}", fault.at.seconds(), fault.code, fault.status);
        }
    }
    hprintln!("heap in use: {} of {} bytes", HEAP.used(), HEAP_BYTES);
    Ok(())
}

/// Returns the sample of the rig at `t_s`; its controller moves the ball back and forth.
fn sample(plant: &mut Twin, t_s: f64) -> Option<Sample> {
    let ball = *plant.motion();
    let set_point = 0.03 * sin_cos(2.0 * t_s).0;
    let control = |wanted: f64, x: f64, v: f64| (0.8 * (wanted - x) - 0.5 * v).clamp(-0.2, 0.2);
    let cmd_qy = control(set_point, ball.position.x, ball.velocity.x);
    let cmd_qx = -control(-set_point, ball.position.y, ball.velocity.y);
    let executed = PerAxis { x: Some(if t_s < 10.0 { cmd_qy } else { 0.0 }), y: Some(cmd_qx) };
    plant.advance(SimTime::new(t_s)?, executed, &RollingState::default());
    Some(Sample {
        seq: None,
        t_s,
        cmd_qx_rad: Some(cmd_qx),
        cmd_qy_rad: Some(cmd_qy),
        x_m: Some(ball.position.x),
        y_m: Some(ball.position.y),
    })
}
