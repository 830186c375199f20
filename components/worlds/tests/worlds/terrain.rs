//! Terrain: heights of its layers compared with closed forms, rays with marching, nearest points with a
//! search.

use motorium_worlds::{HeightField, Ray, RayScene, Terrain, World, WorldError};
use nalgebra::{Point3, Unit, Vector3};

use crate::random::Random;

fn terrain(text: &str) -> Terrain {
    toml::from_str(&format!("size = [8.0, 6.0]\n{text}")).unwrap()
}

fn field(text: &str) -> HeightField {
    terrain(text).height_field().unwrap()
}

fn scene(terrain: Terrain) -> RayScene {
    let mut scene = RayScene::default();
    scene.add_world(&World { terrain: Some(terrain), ..World::default() });
    scene
}

#[test]
fn layer_heights_match_their_equations_and_add_up() {
    let wave = field("layers = [{ equation = { height = '0.2 * sin(2 * x) * cos(y)' } }]");
    let slope = field(
        "layers = [{ slope = { angle = 0.2, direction = 1.5707963267948966, from = 0.5, length = 1.0 } }]",
    );
    let steps =
        field("spacing = 0.02\nlayers = [{ steps = { rise = 0.1, run = 0.3, count = 4, from = 1.0 } }]");
    let gaps =
        field("spacing = 0.02\nlayers = [{ gaps = { width = 0.2, every = 1.0, depth = 0.5, from = 1.0 } }]");
    let both = field("layers = [{ slope = { angle = 0.2 } }, { equation = { height = '0.1 * y' } }]");
    let mut random = Random(5);
    for _ in 0..2000 {
        let (x, y) = (3.9 * random.next(), 2.9 * random.next());
        // linear between heights: off by at most spacing^2 / 8 times the curvature
        assert!((wave.height(x, y) - 0.2 * (2.0 * x).sin() * y.cos()).abs() < 0.05 * 0.05 / 8.0 * 2.5);
        let expected = 0.2_f64.tan() * (y - 0.5).clamp(0.0, 1.0);
        assert!((slope.height(x, y) - expected).abs() < 1e-3, "{x} {y}");
        assert!((both.height(x, y) - 0.2_f64.tan() * x.max(0.0) - 0.1 * y).abs() < 0.006);
        let step = ((x - 1.0) / 0.3).floor();
        if ((x - 1.0) / 0.3 - step - 0.5).abs() < 0.4 {
            assert!((steps.height(x, y) - 0.1 * (step + 1.0).clamp(0.0, 4.0)).abs() < 1e-9, "{x}");
        }
        let place = (x - 1.0).rem_euclid(1.0);
        if x > 1.0 && (0.03..0.17).contains(&place) {
            assert_eq!(gaps.height(x, y), -0.5, "{x}");
        }
        if x < 0.97 || (0.23..0.97).contains(&place) {
            assert_eq!(gaps.height(x, y), 0.0, "{x}");
        }
    }
    let normal = slope.normal(0.0, 1.0);
    assert!((normal - Vector3::new(0.0, -(0.2_f64.sin()), 0.2_f64.cos())).norm() < 1e-9, "{normal}");
}

#[test]
fn random_layers_depend_on_the_seed_only_and_keep_their_size() {
    for layer in [
        "stones = { height = 0.05, size = 0.3, per_square_metre = 4.0 }",
        "diamond_square = { height = 0.05 }",
    ] {
        let of = |seed: u64| field(&format!("seed = {seed}\nflat = 0.5\nlayers = [{{ {layer} }}]"));
        let (one, same, other) = (of(1), of(1), of(2));
        assert_eq!(one, same);
        assert_ne!(one, other);
        let (low, high) = one.range();
        assert!(low >= -0.05 && high <= 0.05 && high > 0.02, "{layer}: {low} to {high}");
        for angle in 0..20 {
            let (sin, cos) = f64::from(angle).sin_cos();
            assert_eq!(one.height(0.4 * cos, 0.4 * sin), 0.0, "level near the origin");
        }
    }
    let stones = field(
        "spacing = 0.02\nlayers = [{ stones = { height = 0.05, size = 0.3, per_square_metre = 4.0 } }]",
    );
    // Uncovered positions: Poisson's distribution, with the mean area of a disc of radius 0.075 (1 + u).
    let area = std::f64::consts::PI * 0.075 * 0.075 * 7.0 / 3.0;
    let mut random = Random(8);
    let bare = (0..20_000).filter(|_| stones.height(3.6 * random.next(), 2.6 * random.next()) == 0.0).count();
    let (share, expected) = (bare as f64 / 20_000.0, (-4.0 * area).exp());
    assert!((share - expected).abs() < 0.05, "{share}, expected {expected}");
}

#[test]
fn ray_hits_terrain_where_marching_first_goes_below() {
    let rough = terrain(
        "seed = 3\nlayers = [{ diamond_square = { height = 0.4, roughness = 0.6 } }, { steps = { rise = 0.2, run = 0.4, count = 3 } }]",
    );
    let (field, scene) = (rough.height_field().unwrap(), scene(rough));
    let mut random = Random(11);
    let (mut met, mut passed) = (0, 0);
    for _ in 0..3000 {
        let origin = Point3::new(5.0 * random.next(), 4.0 * random.next(), 0.8 + 0.7 * random.next());
        let direction = Unit::new_normalize(Vector3::new(random.next(), random.next(), 0.6 * random.next()));
        let ray = Ray { origin, direction };
        let above = |at: f64| {
            let point = ray.point(at);
            point.z - field.height(point.x, point.y)
        };
        let hit = scene.cast(&ray, 6.0);
        if above(0.0) <= 0.0 {
            assert_eq!(hit, None, "from below");
            continue;
        }
        let end = hit.map_or(6.0, |hit| hit.distance);
        let mut at = 0.0;
        while at < end - 1e-3 {
            assert!(above(at) > -1e-4, "below at {at}, before {end}");
            at += 2e-3;
        }
        match hit {
            Some(hit) => {
                met += 1;
                assert!(above(hit.distance).abs() < 1e-9, "{}", above(hit.distance));
                assert!(hit.normal.dot(&direction) < 0.0);
                let point = ray.point(hit.distance);
                let beside = ray.point(hit.distance + 1e-6);
                let normals = [field.normal(point.x, point.y), field.normal(beside.x, beside.y)];
                assert!(normals.iter().any(|normal| (normal - hit.normal).norm() < 1e-9));
            }
            None => passed += 1,
        }
    }
    assert!(met > 1000 && passed > 300, "{met} {passed}");
}

#[test]
fn rays_straight_down_and_along_steps_hit_terrain() {
    let scene = scene(terrain("layers = [{ steps = { rise = 0.5, run = 1.0, count = 1, from = 1.0 } }]"));
    let cast = |origin: [f64; 3], direction: [f64; 3]| {
        let ray =
            Ray { origin: Point3::from(origin), direction: Unit::new_normalize(Vector3::from(direction)) };
        scene.cast(&ray, 50.0).map(|hit| hit.distance)
    };
    assert_eq!(cast([0.0, 0.0, 2.0], [0.0, 0.0, -1.0]), Some(2.0));
    assert_eq!(cast([1.5, 0.3, 2.0], [0.0, 0.0, -1.0]), Some(1.5));
    // the front of the step is a slope of one cell before 1.0
    let front = cast([-1.0, 0.1, 0.25], [1.0, 0.0, 0.0]).unwrap();
    assert!((front - 1.975).abs() < 1e-9, "{front}");
    assert_eq!(cast([-1.0, 0.0, 0.51], [1.0, 0.0, 0.0]), None, "over it");
    assert_eq!(cast([20.0, 9.0, 1.5], [0.0, 0.0, -1.0]), Some(1.0), "it continues beyond the edge");
    assert_eq!(cast([0.0, 0.0, 1.0], [0.0, 0.0, 1.0]), None);
}

#[test]
fn the_triangles_near_a_point_contain_the_nearest_point() {
    let field = field("seed = 4\nspacing = 0.1\nlayers = [{ diamond_square = { height = 0.3 } }]");
    let mut random = Random(13);
    for _ in 0..200 {
        let (x, y) = (3.0 * random.next(), 2.0 * random.next());
        let point = Point3::new(x, y, field.height(x, y) + 0.1 * (1.0 + random.next()));
        let mut nearest = f64::INFINITY;
        field.visit_near(&point, 0.25, &mut |triangle| {
            let place = triangle.nearest;
            assert!((field.height(place.x, place.y) - place.z).abs() < 1e-9);
            nearest = nearest.min((point - place).norm());
        });
        let mut searched = f64::INFINITY;
        for i in -50..=50 {
            for j in -50..=50 {
                let (x, y) = (x + 0.004 * f64::from(i), y + 0.004 * f64::from(j));
                searched = searched.min((point - Point3::new(x, y, field.height(x, y))).norm());
            }
        }
        assert!(nearest <= searched + 1e-9 && searched < nearest + 0.004, "{nearest} {searched}");
    }
}

#[test]
fn invalid_terrain_is_rejected_with_its_key() {
    for (text, expected) in [
        ("spacing = 1e-4\nlayers = []", "raise `spacing`"),
        ("spacing = -1.0\nlayers = []", "`spacing` is -1"),
        ("layers = [{ equation = { height = '1 / (x - x)' } }]", "expected a finite number"),
        (
            "layers = [{ slope = { angle = 0.1 } }, { equation = { height = 'sinn(x)' } }]",
            "`layers[1].equation.height`",
        ),
        ("layers = [{ gaps = { width = 0.5, every = 0.2, depth = 0.1 } }]", "a length above `width`"),
        ("friction = -1.0\nlayers = []", "`friction` is -1"),
        ("spacing = 1e-300\nlayers = []", "at least 1e-4"),
        ("centre = [4.0, 9223372036854775807]\nlayers = []", "a number from -1e6 to 1e6"),
        (
            "spacing = 0.05\nlayers = [{ stones = { height = 0.1, size = 0.4, per_square_metre = 1e5 } }]",
            "`layers[0].stones.per_square_metre` is 100000",
        ),
        (
            "layers = [{ stones = { height = 0.1, size = 1e3, per_square_metre = 40.0 } }]",
            "expected fewer or smaller stones",
        ),
    ] {
        let error = terrain(text).height_field().unwrap_err().to_string();
        assert!(error.contains(expected), "{text}: {error}");
    }
    let world: World = toml::from_str("ground = {}\nterrain = { size = [1.0, 1.0], layers = [] }").unwrap();
    assert_eq!(world.check(std::iter::empty()), Err(WorldError::TwoGrounds));
}
