//! The files of the motion library, and recordings read from files.

use motorium_library::{
    BuildError, Interpolation, Metric, MotionLibrary, Recordings, SampledSpring, Truncation, file,
};
use motorium_recordings::Selection;

use crate::recorded::{golden, library, recordings, spring};

#[test]
fn library_survives_its_file() {
    let folder = tempfile::tempdir().unwrap();
    for metric in [Metric::Force, Metric::Position] {
        let path = folder.path().join("a.library");
        let library = library(metric);
        file::write(&library, &path).unwrap();
        assert_eq!(file::read(&path).unwrap(), library);
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "no temporary file remains");
}

#[test]
fn file_stores_the_interpolation_and_defaults_to_linear() {
    let linear = MotionLibrary::build(
        &recordings(&golden()),
        spring().with_interpolation(Interpolation::Linear),
        Metric::Force,
        Truncation::All,
    )
    .unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("motions.library");
    for (library, interpolation) in
        [(library(Metric::Force), Interpolation::Spline), (linear.clone(), Interpolation::Linear)]
    {
        file::write(&library, &path).unwrap();
        assert_eq!(file::read(&path).unwrap().spring().interpolation(), interpolation);
    }
    // as written by an earlier version: without the key
    let written = serde_json::to_value(linear.spring()).unwrap();
    let mut old = written.clone();
    old.as_object_mut().unwrap().remove("interpolation");
    let old: SampledSpring = serde_json::from_value(old).unwrap();
    assert_eq!(old, *linear.spring());
}

#[test]
fn invalid_files_are_rejected_with_the_reason() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.library");
    let whole = file::to_bytes(&library(Metric::Force));
    let refuse = |bytes: &[u8]| {
        std::fs::write(&path, bytes).unwrap();
        file::read(&path).unwrap_err().to_string()
    };
    for cut in [0, 7, 63, 64, 500, whole.len() - 1] {
        let error = refuse(&whole[..cut]);
        assert!(
            error.contains("a.library")
                && (error.contains("truncated") || error.contains("not a motion library")),
            "{error}"
        );
    }
    let changed = |at: usize, by: u8| {
        let mut bytes = whole.clone();
        bytes[at] ^= by;
        bytes
    };
    assert!(refuse(&changed(whole.len() / 2, 1)).contains("checksum"));
    assert!(refuse(&changed(8, 2)).contains("version 3"));
    assert!(refuse(&changed(0, 1)).contains("not a motion library"));
    assert!(refuse(&[whole.clone(), vec![0]].concat()).contains("has extra bytes"));
}

#[test]
fn oversized_head_is_rejected() {
    let whole = library(Metric::Force);
    let part = whole.split(&whole.layout().part("part=leg").unwrap()).unwrap();
    for (library, refusal) in [(&whole, "invalid header: "), (&part, "section `basis`")] {
        let bytes = file::to_bytes(library);
        let head = usize::try_from(u64::from_le_bytes(bytes[24..32].try_into().unwrap())).unwrap();
        let text = std::str::from_utf8(&bytes[64..64 + head]).unwrap();
        let text = text.replace("\"samples\":48", "\"samples\":18446744073709551615");
        let mut changed = [&bytes[..64], text.as_bytes(), &bytes[64 + head..]].concat();
        let sum = twox_hash::XxHash3_64::oneshot(&changed[64..]);
        let length = changed.len() as u64;
        for (at, value) in [(16, length), (24, text.len() as u64), (32, sum)] {
            changed[at..at + 8].copy_from_slice(&value.to_le_bytes());
        }
        // moved to an address that is a multiple of 8
        let mut words = vec![0_u64; changed.len().div_ceil(8)];
        let aligned: &mut [u8] = &mut bytemuck::cast_slice_mut(&mut words)[..changed.len()];
        aligned.copy_from_slice(&changed);
        let error = file::View::new(aligned).unwrap_err().to_string();
        assert!(error.contains(refusal), "{error}");
    }
}

#[test]
fn mapped_file_is_read_in_place() {
    let library = library(Metric::Force);
    let bytes = file::to_bytes(&library);
    let mut words = vec![0_u64; bytes.len().div_ceil(8)];
    words.iter_mut().zip(bytes.chunks(8)).for_each(|(word, chunk)| {
        let mut all = [0; 8];
        all[..chunk.len()].copy_from_slice(chunk);
        *word = u64::from_ne_bytes(all);
    });
    let mapped: &[u8] = &bytemuck::cast_slice(&words)[..bytes.len()];
    let view = file::View::new(mapped).unwrap();
    assert_eq!(view.basis, library.parts().basis.as_slice());
    assert!(mapped.as_ptr_range().contains(&view.weights.as_ptr().cast()));
    assert_eq!(view.movements().nth(1), Some(("m1", Some("odd"))));
}

#[test]
fn recordings_of_files_and_folders_share_their_dofs() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        path
    };
    let even = write("even.csv", "# loop=wrap\nframe_dt,a,b\n0.5,1,2\n0.5,3,4\n0.5,5,6\n");
    // a cubic through t^2 in uneven samples, at even times 0, 1, 2, 3
    let uneven = write("uneven.csv", "time_s,a,b\n0,0,0\n0.5,0.25,1\n1,1,2\n3,9,6\n");
    let lines = write("lines.jsonl", "{\"id\":7,\"label\":\"l\",\"a\":[1,2],\"b\":[0,0]}\n");
    let selection = Selection { rate: Some(10.0), ..Selection::default() };
    let set = Recordings::read([even, uneven, lines], &selection).unwrap();
    assert_eq!(set.names, ["a", "b"]);
    let described: Vec<_> =
        set.trajectories.iter().map(|t| (t.id.as_str(), t.label.as_deref(), t.duration)).collect();
    assert_eq!(described, [("even", None, 1.0), ("uneven", None, 3.0), ("7", Some("l"), 0.1)]);
    let positions = &set.trajectories[1].positions;
    for (k, [a, b]) in [[0.0, 0.0], [1.0, 2.0], [4.0, 4.0], [9.0, 6.0]].into_iter().enumerate() {
        assert!((positions[(k, 0)] - a).abs() < 1e-12 && (positions[(k, 1)] - b).abs() < 1e-12);
    }
    write("other.csv", "a,c\n1,2\n3,4\n");
    let error = Recordings::read([folder.path()], &selection).unwrap_err().to_string();
    assert!(
        error.contains("recording `other`") && error.contains("a, c, expected a, b as in the first"),
        "{error}"
    );
    let error = Recordings::read([write("x.csv", "a,b\n1,2\n1,x\n")], &selection).unwrap_err();
    assert!(error.to_string().contains("x.csv, line 3, column 2 (`b`): found `x`"), "{error}");
}

#[test]
fn invalid_recordings_are_rejected() {
    let mut set = recordings(&golden());
    set.trajectories[4].positions[(10, 1)] = f64::NAN;
    let error = MotionLibrary::build(&set, spring(), Metric::Force, Truncation::All).unwrap_err().to_string();
    assert!(error.contains("`m4`: sample 10 of degree of freedom 1"), "{error}");
    set.trajectories.clear();
    assert_eq!(
        MotionLibrary::build(&set, spring(), Metric::Force, Truncation::All).unwrap_err(),
        BuildError::NoRecordings
    );
}
