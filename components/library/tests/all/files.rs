//! The files of the motion library, and recordings read from files.

use motorium_library::{BuildError, Keep, Metric, MotionLibrary, data, file};

use crate::recorded::{golden, library, recordings, spring};

#[test]
fn a_library_survives_its_file() {
    let folder = tempfile::tempdir().unwrap();
    for metric in [Metric::Force, Metric::Position] {
        let path = folder.path().join("a.library");
        let library = library(metric);
        file::write(&library, &path).unwrap();
        assert_eq!(file::read(&path).unwrap(), library);
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "nothing is left beside it");
}

#[test]
fn a_torn_changed_or_foreign_file_is_refused_with_what_is_wrong() {
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
                && (error.contains("cut short") || error.contains("no motion library")),
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
    assert!(refuse(&changed(0, 1)).contains("no motion library"));
    assert!(refuse(&[whole.clone(), vec![0]].concat()).contains("something was added"));
}

#[test]
fn a_mapped_file_is_read_where_it_lies() {
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
fn recordings_are_read_from_all_formats_and_refused_with_their_line() {
    let folder = tempfile::tempdir().unwrap();
    let read = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        data::read(&path, &data::Options { rate: 10.0, columns: vec![] })
    };
    let set = read("a.jsonl", "{\"id\":1,\"label\":\"l\",\"n\":3,\"vx\":[1,2,3],\"vy\":[0,0,1]}\n").unwrap();
    assert_eq!(set.names, ["x", "y"]);
    assert!(
        (set.trajectories[0].positions[(2, 0)] - 0.6).abs() < 1e-12 && set.trajectories[0].duration == 0.2
    );
    let set = read("b.json", r#"{"recordings":[{"letter":"A","demo":3,"duration":2,"x":[1,2],"y":[3,4]}]}"#)
        .unwrap();
    assert_eq!((set.trajectories[0].id.as_str(), set.trajectories[0].duration), ("A-3", 2.0));
    let set = read("c.json", r#"{"names":["a"],"positions":[[1],[2],[4]]}"#).unwrap();
    assert_eq!(set.trajectories[0].positions[(2, 0)], 4.0);
    let set = read("d.csv", "# loop=wrap\nframe_dt,a,b\n0.5,1,2\n0.5,3,4\n0.5,5,6\n").unwrap();
    assert_eq!(
        (set.names.len(), set.trajectories[0].duration, set.trajectories[0].id.as_str()),
        (2, 1.0, "d")
    );
    let error = read("e.csv", "a,b\n1,2\n1,x\n").unwrap_err().to_string();
    assert!(error.contains("e.csv, line 3") && error.contains("`b` is `x`"), "{error}");
    let error = read("f.jsonl", "{\"x\":[1,2]}\n{\"x\":[1,\n").unwrap_err().to_string();
    assert!(error.contains("f.jsonl, line 2"), "{error}");
}

#[test]
fn recordings_that_cannot_be_learned_from_are_refused() {
    let mut set = recordings(&golden());
    set.trajectories[4].positions[(10, 1)] = f64::NAN;
    let error = MotionLibrary::build(&set, spring(), Metric::Force, Keep::All).unwrap_err().to_string();
    assert!(error.contains("`m4`: sample 10 of degree of freedom 1"), "{error}");
    set.trajectories.clear();
    assert_eq!(
        MotionLibrary::build(&set, spring(), Metric::Force, Keep::All).unwrap_err(),
        BuildError::NoRecordings
    );
}
