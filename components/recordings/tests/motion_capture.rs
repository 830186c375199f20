//! Damaged motion-capture files are rejected without a panic.

use motorium_recordings::Skeleton;

const ASF: &str = ":units\n angle deg\n:root\n order TX TY TZ RX RY RZ\n axis XYZ\n orientation 0 0 0\n:bonedata\n begin\n \
    name upper\n direction 1 0 0\n length 2\n axis 0 0 0 XYZ\n dof rz\n end\n begin\n name lower\n direction 1 0 0\n \
    length 1\n axis 0 0 90 XYZ\n dof rx rz\n end\n:hierarchy\n begin\n root upper\n upper lower\n end\n";
const AMC: &str = ":DEGREES\n1\nroot 5 6 7 0 0 0\nupper 0\nlower 0 0\n2\nupper 90\nlower 90 0\n";
const BVH: &str = "HIERARCHY\nROOT hips\n{\nOFFSET 0 0 0\nCHANNELS 3 Zrotation Xrotation Yrotation\nEnd Site\n{\nOFFSET 0 2 \
    0\n}\n}\nMOTION\nFrames: 2\nFrame Time: 0.04\n1 2 3\n0 90 0\n";

/// Replaces, removes and repeats bytes at pseudo-random positions.
fn damaged(text: &str, seed: u64) -> String {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    let mut draw = |below: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % below.max(1)
    };
    let mut bytes = text.as_bytes().to_vec();
    for _ in 0..=draw(4) {
        if bytes.is_empty() {
            break;
        }
        let index = draw(bytes.len());
        match draw(4) {
            0 => bytes[index] = b" 0-9.{}:#\nXez"[draw(12)],
            1 => drop(bytes.remove(index)),
            2 => bytes.truncate(index.max(1)),
            _ => {
                let end = (index + draw(40)).min(bytes.len());
                let part = bytes[index..end].to_vec();
                bytes.splice(index..index, part);
            }
        }
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

#[test]
fn damaged_files_are_read_or_rejected() {
    let skeleton = Skeleton::from_asf("a.asf", ASF).expect("a skeleton");
    skeleton.read_amc("a.amc", AMC, 120.0).expect("a motion");
    Skeleton::from_bvh("a.bvh", BVH).expect("a skeleton");
    let mut refused = [0; 3];
    for seed in 1..3000 {
        refused[0] += usize::from(Skeleton::from_asf("a.asf", &damaged(ASF, seed)).is_err());
        refused[1] += usize::from(skeleton.read_amc("a.amc", &damaged(AMC, seed), 120.0).is_err());
        refused[2] += usize::from(Skeleton::from_bvh("a.bvh", &damaged(BVH, seed)).is_err());
    }
    assert!(refused.iter().all(|count| (300..2999).contains(count)), "{refused:?}");
}
