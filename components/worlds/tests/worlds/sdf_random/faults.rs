//! Valid SDF that a world cannot contain, with the error of the reader.

use super::generator::Writer;

/// An element that a world cannot contain.
#[derive(Default)]
pub(crate) struct Fault {
    /// Text inside the world.
    pub(crate) text: String,
    /// Text after the world.
    pub(crate) after: String,
    /// The version of the file, if that is the fault.
    pub(crate) version: Option<&'static str>,
    /// Part of the error.
    pub(crate) expected: String,
}

const BALL: &str =
    "<collision name=\"c\"><geometry><sphere><radius>0.1</radius></sphere></geometry></collision>";

/// Returns a moving model with these elements inside and next to its link.
fn free(attributes: &str, link: &str, beside: &str) -> String {
    format!("<model name=\"fault\" {attributes}>{beside}<link name=\"l\">{link}</link></model>\n")
}

/// Returns a collision with this shape and surface.
fn collision(geometry: &str, surface: &str) -> String {
    format!("<collision name=\"d\"><geometry>{geometry}</geometry><surface>{surface}</surface></collision>")
}

/// Returns a random element that a world cannot contain.
pub(crate) fn fault(writer: &mut Writer) -> Fault {
    let moving = |link: &str, beside: &str| free("", link, beside);
    let fixed = |geometry: &str| free("", &collision(geometry, ""), "<static>true</static>");
    let unsupported = |inner: &str, outer: &str| format!("<{inner}> in <{outer}> is not supported");
    let kind = ["fixed", "revolute", "prismatic", "continuous", "universal"][writer.below(5)];
    let joint = format!(
        "<joint name=\"j\" type=\"{kind}\"><parent>world</parent><child>l</child><axis><xyz expressed_in=\"__model__\">0 1 0</xyz>\
         <limit><lower>-1</lower><upper>1</upper></limit></axis></joint>"
    );
    let shape = ["ellipsoid", "cone", "heightmap", "polyline", "image", "empty"][writer.below(6)];
    let mask = ["collide_bitmask", "category_bitmask"][writer.below(2)];
    let in_world = ["include", "frame", "joint", "population", "road"][writer.below(5)];
    let in_model = ["include", "frame", "gripper", "model"][writer.below(4)];
    let in_link = ["projector", "particle_emitter"][writer.below(2)];
    let attribute = if writer.minor >= 7 { "relative_to" } else { "frame" };
    let place = writer.below(3);
    let pose = format!("<pose {attribute}=\"other\">0 0 1 0 0 0</pose>");
    let level = |height: f64| {
        format!(
            "<model name=\"p{height}\"><static>1</static><pose>0 0 {height} 0 0 0</pose><link name=\"l\"><collision name=\"c\"><geometry><plane/></geometry></collision></link></model>"
        )
    };
    let faults = [
        (moving(BALL, &joint), "model \"fault\" has a joint".to_owned()),
        (fixed(&format!("<{shape}/>")), unsupported(shape, "geometry")),
        (moving(&collision(&format!("<{shape}/>"), ""), ""), unsupported(shape, "geometry")),
        (
            moving(
                &collision(
                    "<sphere><radius>1</radius></sphere>",
                    &format!("<contact><{mask}>2</{mask}></contact>"),
                ),
                "",
            ),
            format!("<{mask}> of <surface> is not supported"),
        ),
        (
            moving(
                &collision(
                    "<sphere><radius>1</radius></sphere>",
                    "<contact><collide_without_contact>true</collide_without_contact></contact>",
                ),
                "",
            ),
            "<collide_without_contact> of <surface> is not supported".to_owned(),
        ),
        (
            format!("<{in_world} name=\"n\"><uri>model://x</uri><pose>0 0 1 0 0 0</pose></{in_world}>\n"),
            unsupported(in_world, "world"),
        ),
        (moving(BALL, &format!("<{in_model} name=\"n\"/>")), unsupported(in_model, "model")),
        (moving(&format!("{BALL}<{in_link}/>"), ""), unsupported(in_link, "link")),
        (free("placement_frame=\"l\"", BALL, ""), "placement_frame=\"l\" is not supported".to_owned()),
        (
            match place {
                0 => moving(BALL, &pose),
                1 => moving(&format!("{pose}{BALL}"), ""),
                _ => moving(&BALL.replace("<geometry>", &format!("{pose}<geometry>")), ""),
            },
            format!("{attribute}=\"other\" in <pose> is not supported"),
        ),
        (
            moving(BALL, "<link name=\"m\"/>"),
            "a second <link> in a moving <model> is not supported".to_owned(),
        ),
        ("<state world_name=\"w\"/>\n".to_owned(), "<state> of <world> is not supported".to_owned()),
        ("<actor name=\"a\"/>\n".to_owned(), "<actor> of <world> is not supported".to_owned()),
        (moving(&format!("<gravity>false</gravity>{BALL}"), ""), "<gravity> is \"false\"".to_owned()),
        (moving(&format!("<kinematic>1</kinematic>{BALL}"), ""), "<kinematic> is \"1\"".to_owned()),
        (
            fixed("<mesh><uri>tetrahedron.obj</uri><submesh><name>a</name></submesh></mesh>"),
            unsupported("submesh", "mesh"),
        ),
        (fixed("<mesh><uri>model://a/b.obj</uri></mesh>"), "\"model://a/b.obj\" is not a file".to_owned()),
        (moving(&collision("<plane/>", ""), ""), "a plane cannot move".to_owned()),
        (level(5.0) + &level(6.0), "a second level plane".to_owned()),
        (
            fixed("<plane><normal>0 0 -1</normal></plane>"),
            "the normal of a plane points downwards or is zero".to_owned(),
        ),
        (
            moving(
                &format!(
                    "{BALL}{}",
                    collision(
                        "<sphere><radius>1</radius></sphere>",
                        "<friction><ode><mu>0.2</mu><mu2>0.2</mu2></ode></friction>"
                    )
                ),
                "",
            ),
            "its friction or restitution differs".to_owned(),
        ),
        (moving("", ""), "moves and has no <collision>".to_owned()),
        (moving(BALL, "<pose>1 2 3 0 0</pose>"), "<pose> is \"1 2 3 0 0\", expected 6 numbers".to_owned()),
        (
            moving(BALL, "<pose rotation_format=\"axis_angle\">1 2 3 0 0 0</pose>"),
            "rotation_format=\"axis_angle\" is not supported".to_owned(),
        ),
        (
            moving(BALL, "<pose>1 2 3 0 0 0</pose><pose>1 2 3 0 0 0</pose>"),
            "a second <pose> in <model>".to_owned(),
        ),
        (
            moving(&collision("<sphere><radius>1</radius></sphere><box/>", ""), ""),
            "a second shape in <geometry>".to_owned(),
        ),
        (moving(&collision("<sphere/>", ""), ""), "<sphere> has no <radius>".to_owned()),
        (
            moving(&format!("<inertial><weight>3</weight></inertial>{BALL}"), ""),
            unsupported("weight", "inertial"),
        ),
        (
            moving(&format!("<inertial><mass>1 kg</mass></inertial>{BALL}"), ""),
            "<mass> is \"1 kg\", expected a number".to_owned(),
        ),
    ];
    let index = writer.below(faults.len() + 3);
    match faults.into_iter().nth(index) {
        Some((text, expected)) => Fault { text, expected, ..Fault::default() },
        None if index.is_multiple_of(3) => Fault {
            version: Some(["1.3", "1.0", "2.0", "latest"][writer.below(4)]),
            expected: "is not supported, expected 1.4 or later".to_owned(),
            ..Fault::default()
        },
        None if index % 3 == 1 => Fault {
            after: "<world name=\"x\"/>\n".to_owned(),
            expected: "a second <world>".to_owned(),
            ..Fault::default()
        },
        None => Fault {
            after: free("", BALL, ""),
            expected: "<model> next to <world> is not supported".to_owned(),
            ..Fault::default()
        },
    }
}
