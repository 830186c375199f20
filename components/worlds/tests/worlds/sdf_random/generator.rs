//! Writes random worlds in SDF, with closed forms of their frames, masses and surfaces.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use nalgebra::{Matrix3, Vector3};

use super::closed_forms::{Cloud, Frame, Solid};
use super::faults;
use crate::random::Random;

/// OBJ text of the tetrahedron of the closed forms.
pub(crate) const TETRAHEDRON: &str =
    "v 0 0 0\nv 0.25 0 0\nv 0 0.5 0\nv 0 0 0.125\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n";

/// Mass properties of an object in the world.
#[derive(Debug)]
pub(crate) struct Body {
    pub(crate) mass: f64,
    pub(crate) centre: Vector3<f64>,
    /// About the centre, in world axes.
    pub(crate) tensor: Matrix3<f64>,
}

#[derive(Debug)]
pub(crate) struct Expected {
    pub(crate) name: String,
    /// `None` for a fixed object.
    pub(crate) body: Option<Body>,
    pub(crate) solids: Vec<(Solid, Frame)>,
    pub(crate) friction: f64,
    pub(crate) restitution: f64,
    pub(crate) colour: Option<[f64; 3]>,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct Plane {
    pub(crate) height: f64,
    pub(crate) friction: f64,
    pub(crate) restitution: f64,
}

/// A file and the world it describes.
pub(crate) struct File {
    pub(crate) text: String,
    pub(crate) gravity: [f64; 3],
    pub(crate) wind: [f64; 3],
    pub(crate) ground: Option<Plane>,
    pub(crate) objects: Vec<Expected>,
    /// Names of the elements that the reader warns about.
    pub(crate) named: BTreeSet<String>,
    /// Part of the error of a file that a world cannot contain.
    pub(crate) refused: Option<String>,
}

/// A surface as text, with its friction and restitution.
type Surface = (String, f64, f64);

pub(crate) struct Writer {
    random: Random,
    /// SDF 1.`minor`.
    pub(crate) minor: u32,
    models: usize,
    /// Writes only properties that objects have, which cause no warnings.
    plain: bool,
    file: File,
}

/// Returns the file of a seed.
pub(crate) fn file(seed: u64) -> File {
    let mut random = Random(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15));
    (0..8).for_each(|_| _ = random.next());
    let file = File {
        text: String::new(),
        gravity: [0.0, 0.0, -9.8],
        wind: [0.0; 3],
        ground: None,
        objects: Vec::new(),
        named: BTreeSet::new(),
        refused: None,
    };
    let mut writer = Writer { random, minor: 0, models: 0, plain: false, file };
    writer.minor = 4 + writer.below(8) as u32;
    writer.plain = writer.chance(0.4);
    writer.world();
    writer.file
}

impl Writer {
    pub(crate) fn below(&mut self, count: usize) -> usize {
        ((self.random.next() + 1.0) * 0.5 * count as f64) as usize % count
    }

    fn chance(&mut self, share: f64) -> bool {
        (self.random.next() + 1.0) * 0.5 < share
    }

    fn range(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.random.next() + 1.0) * 0.5
    }

    /// Returns a random number, rounded to two decimals.
    fn short(&mut self, low: f64, high: f64) -> f64 {
        (self.range(low, high) * 100.0).round() / 100.0
    }

    fn warns(&mut self, what: &str) {
        self.file.named.insert(what.to_owned());
    }

    fn numbers(&mut self, numbers: &[f64]) -> String {
        let between = [" ", "  ", "\n ", " <!-- m --> "][self.below(4)];
        let parts: Vec<String> = numbers.iter().map(ToString::to_string).collect();
        parts.join(between)
    }

    /// Returns a pose with a random rotation, and its frame.
    fn pose_at(&mut self, origin: [f64; 3], scope: Option<&str>) -> (String, Frame) {
        let attribute = match (scope, self.minor) {
            (Some(scope), 7..) if self.chance(0.2) => format!(" relative_to=\"{scope}\""),
            (Some(_), 7..) if self.chance(0.1) => " relative_to=\"\"".to_owned(),
            (Some(_), 5 | 6) if self.chance(0.2) => " frame=\"\"".to_owned(),
            _ => String::new(),
        };
        let [x, y, z] = origin;
        let kind = if self.minor >= 9 { self.below(3) } else { 0 };
        let angles = [0; 3].map(|_| self.range(-3.0, 3.0));
        let (attributes, numbers, frame) = match kind {
            0 => {
                let [roll, pitch, yaw] = angles;
                (String::new(), vec![x, y, z, roll, pitch, yaw], Frame::from_rpy([x, y, z, roll, pitch, yaw]))
            }
            1 => {
                let [roll, pitch, yaw] = angles.map(|angle| (angle * 60.0).round());
                let radians = [roll, pitch, yaw].map(|angle| angle * core::f64::consts::PI / 180.0);
                let frame = Frame::from_rpy([x, y, z, radians[0], radians[1], radians[2]]);
                let yes = ["true", "1", "True"][self.below(3)];
                (format!(" degrees=\"{yes}\""), vec![x, y, z, roll, pitch, yaw], frame)
            }
            _ => {
                let [i, j, k] = angles;
                let w = self.range(0.1, 3.0);
                let frame = Frame::from_quaternion(origin, [i, j, k, w]);
                (" rotation_format=\"quat_xyzw\"".to_owned(), vec![x, y, z, i, j, k, w], frame)
            }
        };
        let numbers = self.numbers(&numbers);
        (format!("<pose{attribute}{attributes}>{numbers}</pose>"), frame)
    }

    /// Returns a random pose, or sometimes no pose.
    fn pose(&mut self, scope: &str) -> (String, Frame) {
        match self.below(8) {
            0 => (String::new(), Frame::identity()),
            1 => ("<pose/>".to_owned(), Frame::identity()),
            _ => {
                let origin = [0; 3].map(|_| self.range(-2.0, 2.0));
                self.pose_at(origin, Some(scope))
            }
        }
    }

    fn surface(&mut self) -> Surface {
        if self.chance(0.4) {
            return (String::new(), 1.0, 0.0);
        }
        let mu = self.short(0.0, 1.5);
        let mut ode = format!("<mu>{mu}</mu>");
        match self.below(5) {
            _ if self.plain => _ = write!(ode, "<mu2>{mu}</mu2>"),
            0 if mu != 1.0 => self.warns("the default <mu2> of 1"),
            1 => {
                _ = write!(ode, "<mu2>{}</mu2>", mu + 0.5);
                self.warns("<mu2> of <surface>");
            }
            _ => _ = write!(ode, "<mu2>{mu}</mu2>"),
        }
        for (name, value, has_effect) in
            [("fdir1", "1 0 0", true), ("slip1", "0.1", true), ("slip2", "0", false)]
        {
            if self.chance(0.1) && !(self.plain && has_effect) {
                _ = write!(ode, "<{name}>{value}</{name}>");
                if has_effect {
                    self.warns(&format!("<{name}> of <surface>"));
                }
            }
        }
        let mut text = format!("<friction><ode>{ode}</ode>");
        if !self.plain && self.chance(0.1) {
            text += "<torsional><coefficient>1</coefficient><patch_radius>0.01</patch_radius></torsional>";
            self.warns("<torsional> of <surface>");
        }
        if !self.plain && self.chance(0.1) {
            text += "<bullet><friction>0.3</friction></bullet>";
            self.warns("<friction> of <bullet>");
        }
        text += "</friction>";
        let mut restitution = 0.0;
        if !self.plain && self.chance(0.3) {
            restitution = self.short(0.1, 1.0);
            _ = write!(text, "<bounce><restitution_coefficient>{restitution}</restitution_coefficient>");
            match self.below(3) {
                0 => self.warns("the default <threshold> of 100000 m/s"),
                1 => {
                    text += "<threshold>0.1</threshold>";
                    self.warns("<threshold> of <surface>");
                }
                _ => text += "<threshold>0</threshold>",
            }
            text += "</bounce>";
        }
        for (element, name) in [
            ("<ode><kp>100000</kp></ode>", Some("<kp> of <surface>")),
            (
                "<ode><min_depth>0.001</min_depth><max_vel>0.1</max_vel></ode>",
                Some("<min_depth> of <surface>"),
            ),
            ("<ode><kp>1e+13</kp><kd>1</kd></ode>", None),
            ("<collide_bitmask>65535</collide_bitmask>", None),
            ("<collide_without_contact>0</collide_without_contact>", None),
        ] {
            if self.chance(0.05) && !(self.plain && name.is_some()) {
                _ = write!(text, "<contact>{element}</contact>");
                name.into_iter().for_each(|name| self.warns(name));
                break;
            }
        }
        (format!("<surface>{text}</surface>"), mu, restitution)
    }

    fn solid(&mut self) -> (String, Solid) {
        let [a, b, c] = [0; 3].map(|_| self.range(0.05, 0.6));
        let round = |name: &str| format!("<{name}><radius>{a}</radius><length>{b}</length></{name}>");
        match self.below(if self.minor >= 8 { 5 } else { 4 }) {
            0 => (format!("<box><size>{}</size></box>", self.numbers(&[a, b, c])), Solid::Box([a, b, c])),
            1 => (format!("<sphere><radius>{a}</radius></sphere>"), Solid::Sphere(a)),
            2 => (round("cylinder"), Solid::Cylinder(a, b)),
            3 => {
                let scale = [a, b, c].map(|side| 4.0 * side * if self.chance(0.3) { -1.0 } else { 1.0 });
                let numbers = self.numbers(&scale);
                let uri = ["tetrahedron.obj", "file://tetrahedron.obj", " ./tetrahedron.obj "][self.below(3)];
                (format!("<mesh><uri>{uri}</uri><scale>{numbers}</scale></mesh>"), Solid::Tetrahedron(scale))
            }
            _ => (round("capsule"), Solid::Capsule(a, b)),
        }
    }

    /// Returns a collision, and its solid with its frame in the link.
    fn collision(&mut self, link: &str, surface: &str, more: &str) -> (String, Solid, Frame) {
        let (pose, frame) = self.pose(link);
        let (geometry, solid) = self.solid();
        let index = self.below(1_000_000);
        let extra =
            if self.chance(0.2) { "<max_contacts>4</max_contacts><laser_retro>1</laser_retro>" } else { "" };
        let text = format!(
            "<collision name=\"c{index}\">{more}{pose}{extra}<geometry>{geometry}</geometry>{surface}</collision>\n"
        );
        (text, solid, frame)
    }

    /// Returns visuals with the colours of this number of collisions.
    fn visuals(&mut self, collisions: usize) -> (String, Vec<Option<[f64; 3]>>) {
        let (mut text, mut colours) = (String::new(), Vec::new());
        for index in 0..self.below(3) {
            let colour = self.chance(0.7).then(|| [0; 3].map(|_| self.short(0.0, 1.0)));
            let diffuse = colour
                .map(|colour| format!("<material><diffuse>{} 1</diffuse></material>", self.numbers(&colour)));
            _ = write!(text, "<visual name=\"v{index}\">{}</visual>", diffuse.unwrap_or_default());
            colours.push(colour);
        }
        let of = |place: usize| colours.get(place).or(colours.last()).copied().flatten();
        (text, (0..collisions).map(of).collect())
    }

    fn name(&mut self) -> String {
        self.models += 1;
        format!("model{}x", self.models)
    }

    /// Writes a static model in a frame, with nested models.
    fn fixed(&mut self, around: &Frame, scope: &str, depth: usize) {
        let name = self.name();
        let (pose, frame) = self.pose(scope);
        let frame = around.then(&frame);
        let stated = match depth {
            0 => format!("<static>{}</static>", ["true", "1", "TRUE"][self.below(3)]),
            _ => ["", "<static>false</static>", "<static>0</static>"][self.below(3)].to_owned(),
        };
        _ = writeln!(self.file.text, "<model name=\"{name}\">{pose}{stated}");
        for index in 0..=self.below(2) {
            let link = format!("l{index}");
            let (pose, within) = self.pose("__model__");
            let within = frame.then(&within);
            _ = writeln!(self.file.text, "<link name=\"{link}\">{pose}");
            if self.chance(0.2) {
                self.file.text +=
                    "<inertial><pose>1 2 3 0 0 0</pose><mass>5</mass></inertial><gravity>0</gravity>";
            }
            let count = 1 + self.below(3);
            let (visuals, colours) = self.visuals(count);
            for colour in colours {
                let (surface, friction, restitution) = self.surface();
                let (text, solid, inner) = self.collision(&link, &surface, "");
                self.file.text += &text;
                let solids = vec![(solid, within.then(&inner))];
                self.file.objects.push(Expected {
                    name: name.clone(),
                    body: None,
                    solids,
                    friction,
                    restitution,
                    colour,
                });
            }
            _ = writeln!(self.file.text, "{visuals}</link>");
        }
        if self.chance(0.3) {
            let kind = ["fixed", "revolute", "prismatic", "continuous"][self.below(4)];
            _ = writeln!(
                self.file.text,
                "<joint name=\"j\" type=\"{kind}\"><parent>world</parent><child>l0</child><axis><xyz>0 0 1</xyz></axis></joint>"
            );
        }
        if depth < 2 && self.minor >= 5 && self.chance(0.3) {
            self.fixed(&frame, "__model__", depth + 1);
        }
        self.file.text += "</model>\n";
    }

    /// Writes a freely moving model with one link.
    fn free(&mut self) {
        let name = self.name();
        let (pose, model) = self.pose("world");
        let (link_pose, within) = self.pose("__model__");
        let (surface, friction, restitution) = self.surface();
        let count = 1 + self.below(3);
        let automatic = self.minor >= 11 && self.chance(0.5);
        let of_link = (automatic && self.chance(0.5)).then(|| self.short(100.0, 3000.0));
        let (mut collisions, mut solids, mut clouds) = (String::new(), Vec::new(), Vec::new());
        for _ in 0..count {
            let own = (automatic && self.chance(0.5)).then(|| self.short(100.0, 3000.0));
            let more = own.map_or_else(String::new, |density| format!("<density>{density}</density>"));
            let (text, solid, inner) = self.collision("l", &surface, &more);
            collisions += &text;
            let density = if automatic { own.or(of_link).unwrap_or(1000.0) } else { 1.0 };
            clouds.push(solid.cloud(density * solid.volume()).moved(&inner));
            solids.push((solid, model.then(&within).then(&inner)));
        }
        // by volume, about the link
        let mut whole = Cloud::sum(&clouds);
        let mut extra = String::new();
        let inertial = if automatic {
            if !self.plain && self.chance(0.2) {
                extra += "<mass>7</mass>";
                self.warns("<mass> of <inertial auto>");
            }
            let density = of_link.map_or_else(String::new, |density| format!("<density>{density}</density>"));
            format!("<inertial auto=\"{}\">{density}{extra}</inertial>", ["true", "1"][self.below(2)])
        } else {
            let mass = if self.chance(0.7) { Some(self.short(0.1, 20.0)) } else { None };
            whole = whole.with_mass(mass.unwrap_or(1.0));
            let mass = mass.map_or_else(String::new, |mass| format!("<mass>{mass}</mass>"));
            self.inertial(&whole, &mass)
        };
        let (visuals, colours) = self.visuals(1);
        let mut more = String::new();
        for (element, name) in [
            ("<velocity_decay><linear>0.1</linear></velocity_decay>", Some("<velocity_decay> of <link>")),
            ("<velocity_decay><linear>0</linear><angular>0.0</angular></velocity_decay>", None),
            ("<enable_wind>true</enable_wind>", Some("<enable_wind> of <link>")),
            ("<gravity>true</gravity><kinematic>0</kinematic><self_collide>1</self_collide>", None),
            ("<sensor name=\"s\" type=\"imu\"><pose>1 2 3 0 0 0</pose></sensor>", None),
        ] {
            if self.chance(0.1) && !(self.plain && name.is_some()) {
                more += element;
                name.into_iter().for_each(|name| self.warns(name));
                break;
            }
        }
        let mut of_model =
            ["", "<static>false</static>", "<self_collide>true</self_collide>"][self.below(3)].to_owned();
        if !self.plain && self.chance(0.1) {
            of_model += "<plugin filename=\"libTrackController.so\" name=\"p\"><mass>3</mass></plugin>";
            self.warns("<plugin> of <model>");
        }
        let body = whole.moved(&within).moved(&model);
        let body = Body { mass: body.mass, centre: body.centre, tensor: body.inertia() };
        _ = writeln!(
            self.file.text,
            "<model name=\"{name}\">{pose}{of_model}<link name=\"l\">{link_pose}{inertial}{more}\n{collisions}{visuals}</link></model>"
        );
        let colour = colours[0];
        self.file.objects.push(Expected { name, body: Some(body), solids, friction, restitution, colour });
    }

    /// Returns the inertial of a link with solids of one density and the total mass properties `whole`: equal
    /// values, or values that cause a warning.
    fn inertial(&mut self, whole: &Cloud, mass: &str) -> String {
        match self.below(if self.plain { 2 } else { 4 }) {
            0 | 1 => {
                let (pose, frame) = self.pose_at(whole.centre.into(), None);
                let tensor = frame.turn.transpose() * whole.inertia() * frame.turn;
                let parts: String =
                    [("xx", 0, 0), ("yy", 1, 1), ("zz", 2, 2), ("xy", 0, 1), ("xz", 0, 2), ("yz", 1, 2)]
                        .iter()
                        .map(|(name, row, column)| format!("<i{name}>{}</i{name}>", tensor[(*row, *column)]))
                        .collect();
                format!("<inertial>{mass}{pose}<inertia>{parts}</inertia></inertial>")
            }
            2 => {
                let origin = [0; 3].map(|_| self.range(3.0, 4.0));
                let (pose, _) = self.pose_at(origin, None);
                self.warns("<pose> of <inertial>");
                self.warns("<inertia> of <inertial>");
                let mut more = String::new();
                if self.minor >= 10 && self.chance(0.3) {
                    more += "<fluid_added_mass><xx>1</xx></fluid_added_mass>";
                    self.warns("<fluid_added_mass> of <inertial>");
                }
                format!(
                    "<inertial>{pose}{mass}<inertia><ixx>50</ixx><iyy>60</iyy><izz>70</izz></inertia>{more}</inertial>"
                )
            }
            _ => {
                if whole.centre.norm() > 1e-6 {
                    self.warns("<pose> of <inertial>");
                }
                self.warns("the default <inertia> of 1 kg m2");
                if mass.is_empty() { String::new() } else { format!("<inertial>{mass}</inertial>") }
            }
        }
    }

    /// Writes a level plane: the ground.
    fn ground(&mut self) {
        let [height, link, yaw] = [self.range(-1.0, 1.0), self.range(-1.0, 1.0), self.range(-3.0, 3.0)];
        let normal = ["<normal>0 0 1</normal>", "<normal>0 0 2.5</normal>", ""][self.below(3)];
        let (surface, friction, restitution) = self.surface();
        _ = writeln!(
            self.file.text,
            "<model name=\"ground_plane\"><static>1</static><pose>0.3 0.2 {height} 0 0 {yaw}</pose><link name=\"l\">\
             <pose>1 1 {link} 0 0 0</pose><collision name=\"c\"><geometry><plane>{normal}<size>9 9</size></plane></geometry>\
             {surface}</collision></link></model>"
        );
        self.file.ground = Some(Plane { height: height + link, friction, restitution });
    }

    /// Writes a sloped plane.
    fn slope(&mut self) {
        let name = self.name();
        let (pose, model) = self.pose("world");
        let normal = [self.range(0.2, 1.0), self.range(-1.0, 1.0), self.range(-0.5, 1.0)];
        let (surface, friction, restitution) = self.surface();
        let numbers = self.numbers(&normal);
        _ = writeln!(
            self.file.text,
            "<model name=\"{name}\">{pose}<static>true</static><link name=\"l\"><collision name=\"c\"><geometry><plane>\
             <normal>{numbers}</normal></plane></geometry>{surface}</collision></link></model>"
        );
        let up = model.turn * Vector3::from(normal).normalize();
        let turn = Matrix3::from_columns(&[Vector3::zeros(), Vector3::zeros(), up]);
        let solids = vec![(Solid::Slope, Frame { turn, origin: model.origin })];
        self.file.objects.push(Expected { name, body: None, solids, friction, restitution, colour: None });
        self.warns("the infinite extent of a sloped <plane>");
    }

    fn world(&mut self) {
        let gravity = [self.short(-3.0, 3.0), self.short(-3.0, 3.0), self.short(-20.0, 5.0)];
        let numbers = self.numbers(&gravity);
        let (physics, world) = match (self.below(4), self.minor) {
            (0, _) => ("<max_step_size>0.001</max_step_size>".to_owned(), String::new()),
            (1 | 2, 4 | 5) => (format!("<gravity>{numbers}</gravity>"), String::new()),
            (3, 4 | 5) => ("<gravity>0 0 -1</gravity>".to_owned(), format!("<gravity>{numbers}</gravity>")),
            _ => (String::new(), format!("<gravity>{numbers}</gravity>")),
        };
        if !(physics.starts_with("<max") && world.is_empty()) {
            self.file.gravity = gravity;
        }
        let physics = format!("<physics type=\"ode\">{physics}</physics>\n");
        let parts = if self.chance(0.5) { [physics, world] } else { [world, physics] };
        let fault = self.chance(0.3).then(|| faults::fault(self));
        let version = match &fault {
            Some(faults::Fault { version: Some(version), .. }) => (*version).to_owned(),
            _ => format!("1.{}", self.minor),
        };
        let head = ["<?xml version=\"1.0\" ?>\n", ""][self.below(2)];
        _ = write!(
            self.file.text,
            "{head}<sdf version=\"{version}\">\n<world name=\"w\">\n{}",
            parts.concat()
        );
        if self.chance(0.2) {
            let wind = [0; 3].map(|_| self.short(-5.0, 5.0));
            let numbers = self.numbers(&wind);
            _ = writeln!(self.file.text, "<wind><linear_velocity>{numbers}</linear_velocity></wind>");
            self.file.wind = wind;
        }
        for part in [
            "<scene><ambient>1 1 1 1</ambient></scene><light name=\"sun\" type=\"directional\"/>\n",
            "<plugin filename=\"gz-sim-physics-system\" name=\"p\"/>\n",
        ] {
            if self.chance(0.5) {
                self.file.text += part;
            }
        }
        if !self.plain && self.chance(0.05) {
            self.file.text += "<plugin filename=\"gz-sim-buoyancy-system\" name=\"b\"/>\n";
            self.warns("<plugin> of <world>");
        }
        if self.chance(0.6) {
            self.ground();
        }
        let count = 1 + self.below(4);
        let place = self.below(count);
        for index in 0..count {
            if let Some(fault) = fault.as_ref().filter(|_| index == place) {
                self.file.text += &fault.text;
            }
            match self.below(7) {
                0..3 => self.fixed(&Frame::identity(), "world", 0),
                3 if !self.plain => self.slope(),
                _ => self.free(),
            }
        }
        self.file.text += "</world>\n";
        if let Some(fault) = &fault {
            self.file.text += &fault.after;
        }
        self.file.text += "</sdf>\n";
        self.file.refused = fault.map(|fault| fault.expected);
        let restitutions = self.file.objects.iter().map(|object| object.restitution);
        let mut all = restitutions.chain(self.file.ground.map(|ground| ground.restitution));
        let first = all.next();
        if all.any(|other| Some(other) != first) {
            self.warns("Gazebo's rule for different <restitution_coefficient>s");
        }
    }
}
