//! A build that was killed or interrupted goes on where it was, to the same bytes.

use std::fs;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use super::*;
use crate::base::{Interrupted, Progress};

/// Stops the work once so many photons lie in pages; keeps what was said.
struct Stop {
    after: u64,
    advanced: AtomicU64,
    said: Mutex<Vec<String>>,
}

impl Stop {
    fn after(after: u64) -> Self {
        Self { after, advanced: AtomicU64::new(0), said: Mutex::default() }
    }
}

impl Progress for Stop {
    fn begin(&self, _what: &str, _total: u64, _unit: &str) {}
    fn advance(&self, units: u64) {
        self.advanced.fetch_add(units, Ordering::Relaxed);
    }
    fn finish(&self) {}
    fn say(&self, message: &str) {
        self.said.lock().expect("no panic").push(message.to_owned());
    }
    fn check(&self) -> Result<(), Interrupted> {
        if self.advanced.load(Ordering::Relaxed) >= self.after { Err(Interrupted) } else { Ok(()) }
    }
}

/// Many small batches: partitions are partitioned again, parts are merged.
const SMALL: Size = Size { page_photons: 100, batch_photons: 1200, ..PLAIN };
/// With a note after each.
const NOTED: Size = Size { checkpoint_every: Duration::ZERO, ..SMALL };

#[test]
fn a_build_goes_on_where_it_was_interrupted_to_the_same_bytes() {
    for shape in SHAPES {
        let all = photons(shape, 9000);
        let whole = Built::new(&all, SMALL).bytes();
        for memory in [1200, 1 << 20] {
            let built = Built::new(&all, SMALL);
            fs::remove_file(built.store()).expect("removes");
            let build = |size: Size, stop: &Stop| {
                build_sized(&built.spill(), &built.store(), &about(9000), size, stop)
            };
            let stop = Stop::after(5000);
            assert!(matches!(build(NOTED, &stop), Err(Error::Interrupted(_))), "{shape:?}");
            // As a kill leaves it: a page that was half written.
            let growing = built.dir.path().join("photons.gmp.tmp");
            let mut bytes = fs::read(&growing).expect("grows");
            bytes.extend([7; 99]);
            fs::write(&growing, bytes).expect("writes");
            let went_on = Stop::after(u64::MAX);
            let size = Size { batch_photons: memory, ..SMALL };
            assert_eq!(build(size, &went_on).expect("builds").photons, 9000);
            assert!(built.bytes() == whole, "{shape:?}, {memory}");
            assert!(!growing.exists() && !built.spill().join("building.checkpoint").exists());
            let said = went_on.said.lock().expect("no panic").join("; ");
            // What lies in one point is one batch, and done again.
            assert_eq!(said.contains("goes on after"), !matches!(shape, Shape::Point), "{said}");
        }
    }
}

#[test]
fn what_is_left_of_another_build_is_of_no_use() {
    let all = photons(Shape::Cloud, 9000);
    let built = Built::new(&all, SMALL);
    let other = Provenance { program: "another".to_owned(), ..Provenance::default() };
    let other = About { provenance: other, ..about(9000) };
    fs::remove_file(built.store()).expect("removes");
    let build = |about: &About, stop: &Stop| {
        build_sized(&built.spill(), &built.store(), about, NOTED, stop)
    };
    assert!(build(&other, &Stop::after(5000)).is_err());
    let anew = Stop::after(u64::MAX);
    build(&about(9000), &anew).expect("builds");
    assert!(anew.said.lock().expect("no panic").is_empty());
    assert!(built.bytes() == Built::new(&all, SMALL).bytes());

    // A note with a flipped bit, and one that vouches for more than there is.
    for damage in [
        |note: &mut Vec<u8>| note[200] ^= 1,
        |note: &mut Vec<u8>| {
            let at = note.len() - 5;
            note[at] ^= 1;
        },
    ] {
        assert!(build(&about(9000), &Stop::after(5000)).is_err());
        let note = built.spill().join("building.checkpoint");
        let mut bytes = fs::read(&note).expect("noted");
        damage(&mut bytes);
        fs::write(&note, bytes).expect("writes");
        let anew = Stop::after(u64::MAX);
        build(&about(9000), &anew).expect("builds");
        assert!(built.bytes() == Built::new(&all, SMALL).bytes());
    }
    assert!(build(&about(9000), &Stop::after(5000)).is_err());
    fs::write(built.dir.path().join("photons.gmp.tmp"), b"short").expect("writes");
    build(&about(9000), &Stop::after(u64::MAX)).expect("builds");
    assert!(built.bytes() == Built::new(&all, SMALL).bytes());
}
