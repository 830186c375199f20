//! Memory layout of the used parts of MuJoCo 3.17.0's structures: offsets in bytes on systems with 64-bit
//! pointers. A test compares these offsets with the headers that ship with the library.

/// Version with this layout, as returned by `mj_version`.
pub(super) const VERSION: core::ffi::c_int = 3_017_000;

/// Defines constants for offsets of fields, and a table of all of them.
macro_rules! offsets {
    ($($name:ident = $structure:literal, $field:literal, $offset:literal;)*) => {
        $(pub(super) const $name: usize = $offset;)*

        /// Structure, field and offset of every constant.
        #[cfg(test)]
        pub(super) const OFFSETS: &[(&str, &str, usize)] = &[$(($structure, $field, $offset)),*];
    };
}

offsets! {
    NQ = "mjModel", "nq", 0;
    NV = "mjModel", "nv", 8;
    NBODY = "mjModel", "nbody", 48;
    NJNT = "mjModel", "njnt", 88;
    NMOCAP = "mjModel", "nmocap", 568;
    TIMESTEP = "mjModel", "opt.timestep", 792;
    GRAVITY = "mjModel", "opt.gravity", 848;
    BODY_MOCAP = "mjModel", "body_mocapid", 1832;
    JOINT_QPOS = "mjModel", "jnt_qposadr", 2112;
    JOINT_DOF = "mjModel", "jnt_dofadr", 2120;
    DOF_ARMATURE = "mjModel", "dof_armature", 2328;
    DOF_INVERSE_WEIGHT = "mjModel", "dof_invweight0", 2352;
    DOF_MASS = "mjModel", "dof_M0", 2360;
    WARNINGS = "mjData", "warning", 160264;
    CONTACT_COUNT = "mjData", "ncon", 160560;
    QPOS = "mjData", "qpos", 160688;
    QVEL = "mjData", "qvel", 160696;
    QFRC_APPLIED = "mjData", "qfrc_applied", 160744;
    MOCAP_POS = "mjData", "mocap_pos", 160768;
    MOCAP_QUAT = "mjData", "mocap_quat", 160776;
    CONTACTS = "mjData", "contact", 161472;
}

/// Indices in `warning` of too many contacts and too many constraint rows.
pub(super) const FULL: [usize; 2] = [1, 2];

/// A count of warnings (`mjWarningStat`).
#[repr(C)]
pub(super) struct Warning {
    _last: i32,
    pub(super) number: i32,
}

/// A contact point (`mjContact`).
#[repr(C)]
pub(super) struct Contact {
    /// Distance of the surfaces \[m\], negative for penetration.
    pub(super) distance: f64,
    /// Midpoint between the surfaces \[m\].
    pub(super) position: [f64; 3],
    /// Rows: the normal, from the first to the second geometry, and two tangents.
    pub(super) frame: [f64; 9],
    _solver: [f64; 53],
    _dimension: [i32; 3],
    /// The geometries.
    pub(super) geometries: [i32; 2],
    _flexible: [i32; 6],
    _excluded: i32,
    /// First constraint row, negative if the contact has none.
    pub(super) row: i32,
}

#[cfg(test)]
mod tests {
    use std::fmt::Write as _;
    use std::mem::{offset_of, size_of};
    use std::process::Command;

    use super::*;

    #[test]
    fn layout_matches_the_headers_of_the_library() {
        let Ok(path) = super::super::library::find() else {
            println!("not run: MuJoCo's library was not found (pip install mujoco==3.17.0)");
            return;
        };
        let include = path.parent().expect("a folder").join("include");
        if !include.is_dir() {
            println!("not run: no headers beside {}", path.display());
            return;
        }
        let mut program =
            "#include <stddef.h>\n#include <stdio.h>\n#include <mujoco/mujoco.h>\nint main(void) {\n"
                .to_owned();
        for (structure, field, _) in OFFSETS {
            writeln!(program, "printf(\"%zu \", offsetof({structure}, {field}));").expect("text");
        }
        let contact = ["dist", "pos", "frame", "geom", "efc_address"];
        for field in contact {
            writeln!(program, "printf(\"%zu \", offsetof(mjContact, {field}));").expect("text");
        }
        program += "printf(\"%zu %zu %d %d %d\", sizeof(mjContact), sizeof(mjWarningStat), mjVERSION_HEADER,
            mjWARN_CONTACTFULL, mjWARN_CNSTRFULL); return 0; }";
        let folder = std::env::temp_dir().join(format!("motorium-layout-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder");
        let (source, binary) = (folder.join("layout.c"), folder.join("layout"));
        std::fs::write(&source, program).expect("a file");
        let made = Command::new("cc").arg("-I").arg(&include).arg("-o").arg(&binary).arg(&source).status();
        let output = made.ok().filter(|status| status.success()).map(|_| Command::new(&binary).output());
        std::fs::remove_dir_all(&folder).expect("the folder");
        let Some(output) = output else {
            println!("not run: no C compiler for MuJoCo's headers");
            return;
        };
        let text = String::from_utf8(output.expect("it runs").stdout).expect("numbers");
        let found: Vec<usize> = text.split_whitespace().map(|word| word.parse().expect("a number")).collect();
        let mut expected: Vec<usize> = OFFSETS.iter().map(|(.., offset)| *offset).collect();
        expected.extend([
            offset_of!(Contact, distance),
            offset_of!(Contact, position),
            offset_of!(Contact, frame),
        ]);
        expected.extend([offset_of!(Contact, geometries), offset_of!(Contact, row)]);
        expected.extend([size_of::<Contact>(), size_of::<Warning>(), VERSION as usize, FULL[0], FULL[1]]);
        let names = OFFSETS.iter().map(|(structure, field, _)| format!("{structure}.{field}"));
        for ((name, found), expected) in
            names.chain(std::iter::repeat("mjContact or size".to_owned())).zip(&found).zip(&expected)
        {
            assert_eq!(found, expected, "{name}");
        }
        assert_eq!(found.len(), expected.len());
    }
}
