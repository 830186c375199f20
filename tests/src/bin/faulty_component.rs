//! A user component with configurable faults: it passes a joint state through until the configured step.

use motorium::component::{Component, ConfigureError, Setup, Tick};
use motorium::declare::{ConfigError, Declare, StepError};
use motorium::state::JointState;
use motorium::transport::{Input, Output};

/// The fault to simulate.
#[derive(Debug, Clone, Copy, PartialEq, serde::Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
enum Fault {
    /// No fault.
    None,
    /// The step panics.
    Panic,
    /// The step returns an error.
    Error,
    /// The output contains a NaN.
    Nan,
    /// The process ends in the middle of a step.
    Exit,
    /// The process ends in the middle of a step, and in its configuration after a restart.
    ExitAgain,
    /// The step takes 20 ms.
    Stall,
    /// The step computes for far too long.
    Work,
    /// Configuration fails.
    Configure,
    /// Configuration panics.
    ConfigurePanic,
    /// Configuration never ends.
    ConfigureHang,
    /// Configuration never ends after a restart.
    ConfigureHangAgain,
    /// The process ends during configuration.
    ConfigureExit,
    /// The step allocates memory until none is left.
    Devour,
    /// The step opens files until no descriptors are left.
    Open,
    /// The step allocates.
    Allocate,
    /// The step sleeps for ever.
    Hang,
    /// The step computes for ever.
    Loop,
    /// The step publishes nothing.
    Mute,
    /// The step prints a line.
    Print,
    /// Stopping takes three seconds.
    SlowStop,
}

/// The fault and its steps.
#[derive(Debug, Clone, serde::Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct FaultyConfig {
    /// The fault to simulate.
    fault: Fault,
    /// First step of the fault, which then affects every step up to `until`.
    #[serde(default)]
    at: u64,
    /// First step after the fault.
    #[serde(default = "for_ever")]
    until: u64,
    /// True to fail only in the first process, not after a restart.
    #[serde(default)]
    once: bool,
    /// True to declare an actuator.
    #[serde(default)]
    actuator: bool,
}

fn for_ever() -> u64 {
    u64::MAX
}

struct Faulty {
    input: Input<JointState>,
    output: Output<JointState>,
    stream: Output<JointState>,
    config: FaultyConfig,
    restarted: bool,
    steps: u64,
}

impl Component for Faulty {
    const KIND: &'static str = "test.faulty";
    const SUMMARY: &'static str = "passes a joint state through until it goes wrong";
    type Config = FaultyConfig;

    fn declare(config: &FaultyConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        declare.input::<JointState>("input", "joint state");
        declare.output::<JointState>("output", "the same joint state");
        if config.actuator {
            declare.actuator();
        }
        declare.stream_output::<JointState>("stream", 4, "the same joint state, each value of it");
        declare.float("gain", 1.0, 0.0..=10.0, "", "factor on the positions");
        Ok(())
    }

    fn configure(config: FaultyConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        match config.fault {
            Fault::Configure => return Err(ConfigureError::failed("configured to fail")),
            Fault::ConfigurePanic => panic!("configured to panic"),
            Fault::ConfigureExit => std::process::exit(7),
            Fault::ConfigureHang => hang(),
            _ => {}
        }
        let restarted = setup.checkpoint(1)?.resume().is_some();
        if restarted && config.fault == Fault::ConfigureHangAgain {
            hang();
        }
        if restarted && config.fault == Fault::ExitAgain {
            std::process::exit(8);
        }
        setup.checkpoint(1)?.save([1.0]);
        let (input, output) = (setup.input("input")?, setup.output("output")?);
        let stream = setup.output("stream")?;
        Ok(Self { input, output, stream, config, restarted, steps: 0 })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        self.steps += 1;
        let Some(state) = self.input.latest() else { return Ok(()) };
        let mut value = self.stream.loan()?;
        *value = *state;
        value.publish()?;
        let mut output = self.output.loan()?;
        *output = *state;
        let due = (self.config.at..self.config.until).contains(&tick.index)
            && !(self.config.once && self.restarted);
        if due {
            match self.config.fault {
                Fault::Panic => panic!("ordered to panic"),
                Fault::Error => return Err(StepError::failed("ordered to fail")),
                Fault::Nan => output.position_mut()[0] = f64::NAN,
                Fault::Exit | Fault::ExitAgain => std::process::exit(7),
                Fault::Stall => std::thread::sleep(std::time::Duration::from_millis(20)),
                Fault::Work => {
                    let begun = std::time::Instant::now();
                    while begun.elapsed() < std::time::Duration::from_millis(5) {
                        core::hint::spin_loop();
                    }
                }
                Fault::Allocate => drop(core::hint::black_box(vec![tick.index])),
                Fault::Hang => hang(),
                Fault::Devour => loop {
                    core::mem::forget(vec![1_u8; 1 << 24]);
                },
                Fault::Open => loop {
                    match std::fs::File::open("/dev/null") {
                        Ok(file) => core::mem::forget(file),
                        Err(error) => return Err(StepError::failed(error.to_string())),
                    }
                },
                Fault::Loop => loop {
                    core::hint::spin_loop();
                },
                Fault::Mute => return Ok(()),
                Fault::Print => {
                    println!("step {} of one that prints, which is a line of some length", tick.index)
                }
                Fault::None
                | Fault::SlowStop
                | Fault::Configure
                | Fault::ConfigurePanic
                | Fault::ConfigureExit
                | Fault::ConfigureHang
                | Fault::ConfigureHangAgain => {}
            }
        }
        output.publish()
    }

    fn stop(&mut self) {
        if self.config.fault == Fault::SlowStop {
            std::thread::sleep(std::time::Duration::from_secs(3));
            println!("stopped after three seconds");
        }
    }
}

fn hang() -> ! {
    loop {
        std::thread::sleep(std::time::Duration::from_secs(1));
    }
}

motorium::main!(Faulty);
