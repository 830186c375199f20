//! Terrain from greyscale images, compared with the pixels of the program that wrote them.

use std::path::Path;

use motorium_worlds::{HeightField, Terrain, TerrainError};

const FOLDER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/worlds/golden");

/// Returns the terrain of one image, 9 x 11 pixels over 1.6 m x 2 m, with one height per pixel.
fn terrain(file: &str, more: &str) -> Terrain {
    let text = format!(
        "size = [1.6, 2.0]\ncentre = [0.4, -0.2]\nspacing = 0.2\nlayers = [{{ image = {{ file = \"{file}\", height = [-0.1, 0.9]{more} }} }}]"
    );
    let mut terrain: Terrain = toml::from_str(&text).unwrap();
    terrain.locate(Path::new(FOLDER));
    terrain
}

fn field(file: &str, more: &str) -> HeightField {
    terrain(file, more).height_field().unwrap()
}

/// Returns the pixels of the image of this depth, starting with the top row.
fn pixels(depth: &str) -> Vec<Vec<f64>> {
    let json: serde_json::Value =
        serde_json::from_str(include_str!("golden/heights.json")).expect("written by the script beside it");
    serde_json::from_value(json[depth].clone()).unwrap()
}

#[test]
fn every_pixel_is_a_height_with_x_to_the_right_and_y_up() {
    for (depth, white) in [("8", 255.0), ("16", 65_535.0)] {
        let field = field(&format!("heights_{depth}.png"), "");
        for (row, line) in pixels(depth).iter().enumerate() {
            for (column, pixel) in line.iter().enumerate() {
                let (x, y) = (0.4 - 0.8 + 0.2 * column as f64, -0.2 + 1.0 - 0.2 * row as f64);
                let expected = -0.1 + pixel / white;
                let found = field.height(x, y);
                assert!(
                    (found - expected).abs() < 1e-9,
                    "{depth} bits, row {row}, {column}: {found}, {expected}"
                );
            }
        }
    }
}

#[test]
fn heights_are_interpolated_and_continue_at_the_edge() {
    // the same image over a quarter of the terrain: each height is between two pixels, or beyond all pixels
    let (field, pixels) =
        (field("heights_16.png", ", size = [0.8, 1.0], centre = [0.4, -0.2]"), pixels("16"));
    let height = |grey: f64| -0.1 + grey / 65_535.0;
    // 0.2 m to the right of the middle is two columns, 0.2 m up is two rows
    assert!((field.height(0.6, 0.0) - height(pixels[3][6])).abs() < 1e-9);
    for (x, y, row, column) in [(-0.4, 0.8, 0, 0), (1.2, 0.8, 0, 8), (1.2, -1.2, 10, 8), (-0.2, -1.0, 10, 0)]
    {
        assert!((field.height(x, y) - height(pixels[row][column])).abs() < 1e-9, "{x}, {y}");
    }
    let wide = self::field("heights_16.png", ", size = [3.2, 4.0]");
    // half as many pixels as heights: every other height is between two pixels
    let mean = 0.5 * (pixels[5][4] + pixels[5][5]);
    assert!((wide.height(0.6, -0.2) - height(mean)).abs() < 1e-9);
    let mean = 0.25 * (pixels[4][4] + pixels[4][5] + pixels[5][4] + pixels[5][5]);
    assert!((wide.height(0.6, 0.0) - height(mean)).abs() < 1e-9);
}

/// Returns the error for a file of these bytes.
fn refused(bytes: &[u8]) -> String {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("it.png"), bytes).unwrap();
    let text = "size = [1.0, 1.0]\nlayers = [{ image = { file = \"it.png\", height = [0.0, 1.0] } }]";
    let mut terrain: Terrain = toml::from_str(text).unwrap();
    terrain.locate(folder.path());
    let error = terrain.height_field().unwrap_err();
    assert!(matches!(error, TerrainError::Picture { .. }), "{error}");
    error.to_string()
}

#[test]
fn damaged_images_and_other_formats_are_rejected() {
    let good = std::fs::read(format!("{FOLDER}/heights_8.png")).unwrap();
    assert!(refused(b"P5 9 11 255").contains("this is not a PNG file"));
    assert!(refused(&good[..70]).contains("ends within a chunk"));
    let with = |at: usize, value: u8| {
        let mut bytes = good.clone();
        bytes[at] = value;
        refused(&bytes)
    };
    // fields of the header: depth, colour, interlace
    assert!(with(24, 4).contains("grey of 4 bits, expected grey of 8 or 16 bits"));
    assert!(with(25, 2).contains("colours of 8 bits"));
    assert!(with(28, 1).contains("interlaced"));
    // more pixels than bytes, and fewer
    assert!(with(23, 12).contains("bytes of pixels, expected 120"));
    assert!(with(23, 10).contains("cannot be unpacked"));
    let missing = terrain("none.png", "").height_field().unwrap_err().to_string();
    assert!(missing.starts_with("`layers[0].image.file` = \"") && missing.contains("none.png"), "{missing}");
}

#[test]
fn damaged_bytes_never_panic() {
    let good = std::fs::read(format!("{FOLDER}/heights_16.png")).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("it.png");
    // an absolute path stays as it is
    let terrain = terrain(&path.to_string_lossy(), "");
    let mut refused = 0;
    for at in 0..good.len() {
        let mut bytes = good.clone();
        bytes[at] ^= 0x55;
        std::fs::write(&path, &bytes).unwrap();
        match terrain.height_field() {
            Ok(field) => assert!((-0.1 - 1e-9..=0.9 + 1e-9).contains(&field.height(0.4, -0.2))),
            Err(_) => refused += 1,
        }
    }
    assert!(refused > good.len() / 2, "{refused} of {}", good.len());
}
