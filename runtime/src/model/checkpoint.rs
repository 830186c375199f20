//! Models of checkpoints that survive their writer.

use loom::sync::Arc;
use loom::thread;

use super::{Modelled, holds_only_with};
use crate::atomics::Site;
use crate::region::Checkpoints;

/// At any point of a save, a complete checkpoint is found.
fn a_checkpoint_is_whole() {
    let block = Arc::new(Checkpoints::<Modelled, 2>::empty());
    let successor = {
        let block = block.clone();
        thread::spawn(move || {
            let mut words = [0; 2];
            if block.load(&mut words) {
                assert!(words[0] > 0 && words[1] == 10 * words[0], "{words:?}");
            }
        })
    };
    for number in 1..=2 {
        assert!(block.save([number, 10 * number].into_iter()));
    }
    successor.join().unwrap();
}

#[test]
fn checkpoint_is_found_complete_or_not_at_all() {
    holds_only_with(&[Site::Save, Site::Load], 3, a_checkpoint_is_whole);
}
