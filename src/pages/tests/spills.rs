//! Photons on their way to the store: interrupted, resumed, joined.

use super::*;
use crate::pages::packed::Packed;
use crate::pages::partition::Partition;

/// The photons of each partition, in their order.
fn content(spill: &Path) -> Vec<(u64, Vec<Packed>)> {
    let summary = SpillSummary::read(spill).expect("complete");
    let photons = |partition: &Partition| {
        let mut out = Vec::new();
        partition
            .read(spill, |p| {
                out.push(*p);
                Ok(())
            })
            .map(|()| (partition.cell, out))
    };
    summary.partitions.iter().map(photons).collect::<Result<_, _>>().expect("reads")
}

#[test]
fn a_spill_goes_on_from_its_checkpoint() {
    let keep = tempfile::tempdir().expect("a folder");
    let (whole, cut) = (keep.path().join("whole"), keep.path().join("cut"));
    let all = photons(Shape::Cloud, 20_000);
    let new = |dir: &Path| Spill::create(dir, BOUNDS, 20_000, 1 << 20).expect("creates");
    let mut spill = new(&whole);
    spill.accept(&all).expect("takes");
    spill.finish().expect("completes");
    let expected = content(&whole);
    let mut spill = new(&cut);
    spill.accept(&all[..9000]).expect("takes");
    spill.checkpoint("nine").expect("seals");
    // What comes later reaches the disk in part, and is lost.
    spill.accept(&all[9000..17_000]).expect("takes");
    drop(spill);
    let resume = |bounds, note: &'static str| {
        Spill::resume(&cut, bounds, 20_000, 1 << 20, |found| found == note).expect("reads")
    };
    assert!(resume(BOUNDS, "ten").is_none(), "another note");
    let other = Aabb { min: BOUNDS.min, max: BOUNDS.max * 2.0 };
    assert!(resume(other, "nine").is_none(), "another scene");
    let (mut spill, note) = resume(BOUNDS, "nine").expect("goes on");
    assert_eq!(note, "nine");
    spill.accept(&all[9000..]).expect("takes");
    spill.finish().expect("completes");
    assert!(content(&cut) == expected);
    // Killed inside of the next checkpoint: its beginning lies beside the one that holds.
    std::fs::write(cut.join("checkpoint.json.tmp"), b"{\"note\": \"te").expect("writes");
    let (mut spill, _) = resume(BOUNDS, "nine").expect("goes on");
    spill.accept(&all[9000..12_000]).expect("takes");
    drop(spill);
    // Once more from there, although it was completed; then with a file cut short.
    let (mut spill, _) = resume(BOUNDS, "nine").expect("goes on");
    assert!(matches!(SpillSummary::read(&cut), Err(Error::Unfinished { .. })));
    spill.accept(&all[9000..]).expect("takes");
    spill.finish().expect("completes");
    assert!(content(&cut) == expected);
    let file = SpillSummary::read(&cut).expect("complete").partitions[0].path(&cut);
    std::fs::write(file, b"short").expect("writes");
    assert!(resume(BOUNDS, "nine").is_none(), "a file that is too short");
}

#[test]
fn joined_spills_are_one_spill() {
    let keep = tempfile::tempdir().expect("a folder");
    let at = |name: &str| keep.path().join(name);
    let all = photons(Shape::Clusters, 20_000);
    let fill = |name: &str, some: &[Photon]| {
        let mut spill = Spill::create(&at(name), BOUNDS, 20_000, 1 << 20).expect("creates");
        spill.accept(some).expect("takes");
        spill.finish().expect("completes");
        content(&at(name))
    };
    let whole = fill("whole", &all);
    fill("a", &all[..7000]);
    fill("none", &[]);
    fill("b", &all[7000..]);
    let parts = ["a", "none", "b"].map(at);
    join(&parts, &at("joined"), 1 << 20, &Silent).expect("joins");
    assert!(content(&at("joined")) == whole, "the same photons in the same order");
    std::fs::remove_file(at("b").join("spill.json")).expect("removes");
    let incomplete = join(&parts, &at("joined"), 1 << 20, &Silent);
    assert!(matches!(incomplete, Err(Error::Unfinished { .. })));
}

#[test]
fn an_interrupted_spill_is_known_and_redone() {
    let dir = tempfile::tempdir().expect("a folder");
    let (spill_dir, store) = (dir.path().join("spill"), dir.path().join("photons.gmp"));
    let photons = photons(Shape::Cloud, 3000);
    let build = |store: &Path| build_sized(&spill_dir, store, &about(3000), PLAIN, &Silent);
    let mut spill = Spill::create(&spill_dir, BOUNDS, 3000, 1).expect("creates");
    spill.accept(&photons[..2000]).expect("accepts");
    drop(spill);
    let (found, message) = kind(build(&store));
    assert_eq!(found, FaultKind::Input);
    assert!(message.contains("trace them again"), "{message}");

    let mut spill = Spill::create(&spill_dir, BOUNDS, 3000, 1).expect("creates");
    spill.accept(&photons).expect("accepts");
    spill.finish().expect("finishes");
    assert_eq!(build(&store).expect("builds").photons, 3000);
    assert!(std::fs::read(&store).expect("reads") == Built::new(&photons, PLAIN).bytes());

    // Begun anew, the old summary must not vouch for what isn't there yet.
    let spill = Spill::create(&spill_dir, BOUNDS, 3000, 1).expect("creates");
    drop(spill);
    assert_eq!(kind(build(&store)).0, FaultKind::Input);
    super::super::discard(&spill_dir).expect("removes");
    assert!(!spill_dir.exists());
}
