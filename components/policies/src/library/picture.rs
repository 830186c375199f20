//! The picture of the executed movements.

use std::fmt::Write as _;

/// One movement in the picture.
pub(super) struct Panel {
    pub(super) name: String,
    /// Paths with all eigenforces, as generated, and as measured.
    pub(super) paths: [Vec<[f64; 2]>; 3],
}

/// Draws panels next to each other as SVG: grey with all eigenforces, blue as generated, red as measured.
pub(super) fn svg(panels: &[Panel]) -> String {
    const SIDE: f64 = 260.0;
    const STYLES: [&str; 3] = [
        "stroke=\"#c9d1d9\" stroke-width=\"7\"",
        "stroke=\"#1f6feb\" stroke-width=\"2\"",
        "stroke=\"#d1242f\" stroke-width=\"1\"",
    ];
    let width = SIDE * panels.len().max(1) as f64;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" \
         height=\"{height}\" font-family=\"sans-serif\" font-size=\"14\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n",
        height = SIDE + 50.0
    );
    for (k, panel) in panels.iter().enumerate() {
        let range = |d: usize| {
            let all = panel.paths[0].iter().chain(&panel.paths[1]);
            all.fold([f64::INFINITY, f64::NEG_INFINITY], |r, p| [r[0].min(p[d]), r[1].max(p[d])])
        };
        let (x, y) = (range(0), range(1));
        let scale = 0.8 * SIDE / (x[1] - x[0]).max(y[1] - y[0]).max(1e-12);
        for (path, style) in panel.paths.iter().zip(STYLES).filter(|(path, _)| !path.is_empty()) {
            let mut line = String::new();
            for (i, p) in path.iter().enumerate() {
                let px = SIDE * (k as f64 + 0.5) + scale * (p[0] - 0.5 * (x[0] + x[1]));
                let py = 0.5 * SIDE - scale * (p[1] - 0.5 * (y[0] + y[1]));
                let _ = write!(line, "{}{px:.2} {py:.2}", if i == 0 { "M" } else { "L" });
            }
            let _ = writeln!(
                svg,
                "<path d=\"{line}\" fill=\"none\" stroke-linecap=\"round\" stroke-linejoin=\"round\" {style}/>"
            );
        }
        let name = panel.name.replace('&', "&amp;").replace('<', "&lt;");
        let _ = writeln!(
            svg,
            "<text x=\"{}\" y=\"{}\" text-anchor=\"middle\">{name}</text>",
            SIDE * (k as f64 + 0.5),
            SIDE + 16.0
        );
    }
    let _ = writeln!(
        svg,
        "<text x=\"8\" y=\"{}\" font-size=\"12\" fill=\"#57606a\">grey: all eigenforces; blue: generated; red: \
         measured</text>\n</svg>",
        SIDE + 42.0
    );
    svg
}
