//! Parameters of a session: choices, arrays, and several parameters together.

use std::path::Path;
use std::time::Duration;

use motorium::component::{Choice, ParameterArray};
use motorium::graph::{self, Machine};
use motorium::launcher::Options;
use motorium::prelude::*;
use motorium::session::Session;
use motorium::worker::{Kind, Registry, RobotSource};

#[derive(serde::Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct NoConfig {}

/// Publishes its parameters.
struct Knobs {
    seen: Output<Wrench>,
    scale: Parameter<f64>,
    axis: Parameter<Choice>,
    offsets: ParameterArray,
}

impl Component for Knobs {
    const KIND: &'static str = "test.knobs";
    const SUMMARY: &'static str = "publishes its parameters";
    const RESETS: bool = true;
    type Config = NoConfig;

    fn declare(_: &NoConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        declare.output::<Wrench>("seen", "scale, index of the axis; the offsets");
        declare.float("scale", 1.0, 0.0..=10.0, "", "a number");
        declare.choice("axis", &["roll", "pitch", "yaw"], "roll", "a choice");
        declare.array("offsets", &[0.0; 3], -1.0..=1.0, "rad", "an array");
        Ok(())
    }

    fn configure(_: NoConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        Ok(Self {
            seen: setup.output("seen")?,
            scale: setup.parameter("scale")?,
            axis: setup.parameter("axis")?,
            offsets: setup.parameter_array("offsets")?,
        })
    }

    fn step(&mut self, _: &Tick) -> Result<(), StepError> {
        let mut seen = self.seen.loan()?;
        seen.force = [self.scale.get(), self.axis.get().index() as f64, 0.0];
        seen.torque.iter_mut().zip(self.offsets.iter()).for_each(|(to, from)| *to = from);
        seen.publish()
    }

    fn reset(&mut self, _: &Episode) -> Result<(), StepError> {
        Ok(())
    }
}

const GRAPH: &str = r#"
    name = "knobs"
    clock = "lockstep"
    [component.knobs]
    kind = "test.knobs"
    rate = "1 kHz"
    publish = { seen = "seen" }
    params = { axis = "pitch", offsets = [0.25, 0, -1] }
"#;

fn registry() -> Registry {
    Registry::new(RobotSource { check: |_| Ok(Vec::new()) }, [Kind::of::<Knobs>()])
}

fn check(text: &str) -> Result<motorium::plan::Plan, String> {
    let path = Path::new("knobs.toml");
    let checked = graph::check(path, text.to_string(), &[], &registry(), &Machine::detect());
    checked.map(|checked| checked.plan).map_err(|error| error.render(false))
}

#[test]
fn choices_and_arrays_start_as_configured_and_change_together() {
    let plan = check(GRAPH).unwrap();
    let mut session = Session::launch(plan, &registry(), &Options::inline()).unwrap();
    let next = |session: &mut Session<'_>| {
        session.step().unwrap();
        let Wrench { force, torque } = session.read::<Wrench>("seen").unwrap().unwrap().value;
        (force[0], force[1], torque)
    };
    assert_eq!(next(&mut session), (1.0, 1.0, [0.25, 0.0, -1.0]));

    let refused = session.set_many("knobs", [("scale", 5.0.into()), ("axis", "yam".into())]).unwrap_err();
    assert!(refused.to_string().contains("did you mean `yaw`?"), "{refused}");
    assert_eq!(next(&mut session), (1.0, 1.0, [0.25, 0.0, -1.0]), "none of them");

    let values = [("scale", 5.0.into()), ("axis", "yaw".into()), ("offsets", [0.5, 0.5, 0.5].into())];
    session.set_many("knobs", values).unwrap();
    assert_eq!(next(&mut session), (5.0, 2.0, [0.5; 3]), "all of them");
    session.set("knobs", "axis", "roll").unwrap();
    session.set("knobs", "offsets", [0.0, 0.0, 1.0]).unwrap();
    assert_eq!(next(&mut session), (5.0, 0.0, [0.0, 0.0, 1.0]));

    for (parameter, value, expected) in [
        ("axis", 1_i64.into(), "is 1, expected one of `roll`, `pitch`, `yaw`"),
        ("offsets", [0.0, 0.0].into(), "is an array of 2, expected one number, or an array of 3"),
        ("offsets", [0.0, 0.0, 1.5].into(), "`offsets[2]` is 1.5, expected from -1 to 1"),
        ("ofsets", 1.0.into(), "did you mean `offsets`?"),
    ] {
        let values: [(&str, motorium::declare::ParameterValue); 1] = [(parameter, value)];
        let error = session.set_many("knobs", values).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
    session.reset(3).unwrap();
    assert_eq!(next(&mut session), (5.0, 0.0, [0.0, 0.0, 1.0]), "they persist through resets");
    session.step_until(Duration::from_millis(300)).unwrap();
    assert_eq!(session.stop().components[0].allocations, Some(0));
}

#[test]
fn invalid_choice_or_length_is_refused_at_its_position() {
    let refused = |from: &str, to: &str| check(&GRAPH.replace(from, to)).unwrap_err();
    let text = refused("\"pitch\"", "\"picth\"");
    assert!(text.contains("knobs.toml:8:") && text.contains("did you mean `pitch`?"), "{text}");
    let text = refused("[0.25, 0, -1]", "[0.25, 0]");
    assert!(text.contains("`offsets` is an array of 2, expected one number, or an array of 3"), "{text}");
    let text = refused("[0.25, 0, -1]", "[0.25, \"x\", -1]");
    assert!(text.contains("a number"), "{text}");
    let text = refused("[0.25, 0, -1]", "{ x = 1 }");
    assert!(text.contains("an array of numbers"), "{text}");
}
