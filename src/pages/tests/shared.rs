//! Queries that share candidates: to the last bit what each finds alone.

use glam::Vec3;

use super::{BOUNDS, Built, PLAIN, SHAPES, Shape, photons};
use crate::base::{Purpose, Stream};
use crate::pages::build::Size;
use crate::pages::{Access, Error, Neighbour, Neighbours, Query, Store};

type Answer = (Vec<Neighbour>, Option<usize>, bool);

fn answer(found: &Neighbours) -> Answer {
    (found.items().to_vec(), found.farthest(), found.full())
}

/// Answers alone and shared, which must agree; pages touched by each.
fn compare(store: &Store, queries: &[Query]) -> (u64, u64) {
    let touched = |work: &mut dyn FnMut()| {
        let before = store.cache_stats();
        work();
        let after = store.cache_stats();
        after.hits + after.misses - before.hits - before.misses
    };
    let (mut alone, mut together) = (Vec::new(), Vec::new());
    let mut found = Neighbours::default();
    let pages_alone = touched(&mut || {
        for query in queries {
            store.nearest(query, &mut found).expect("searches");
            alone.push(answer(&found));
        }
    });
    let mut found = Neighbours::default();
    let pages_together = touched(&mut || {
        let each = |number: usize, found: &Neighbours| {
            assert_eq!(number, together.len());
            together.push(answer(found));
            Ok::<(), Error>(())
        };
        store.nearest_each(queries, &mut found, each).expect("searches");
    });
    assert_eq!(together.len(), alone.len());
    for ((query, alone), together) in queries.iter().zip(&alone).zip(&together) {
        assert!(
            alone == together,
            "{query:?}: {} photons alone, {} together, farthest {:?} and {:?}",
            alone.0.len(),
            together.0.len(),
            alone.1,
            together.1
        );
    }
    (pages_alone, pages_together)
}

#[test]
fn shared_answers_are_those_of_each_alone() {
    for shape in SHAPES {
        for page_photons in [50, 8192] {
            let photons = photons(shape, 12_000);
            let built = Built::new(&photons, Size { page_photons, ..PLAIN });
            let store = built.open(1 << 26, Access::Mapped);
            let mut random = Stream::new(11, Purpose::Survey, 0);
            let mut queries = Vec::new();
            for round in 0..40 {
                let mut unit =
                    || Vec3::from_array(std::array::from_fn(|_| random.uniform() as f32 - 0.5));
                let from = match round % 4 {
                    0 => photons[round * 17].position,
                    1 => BOUNDS.min + BOUNDS.size() * (unit() + 0.5),
                    2 => photons[round * 31].position + unit(),
                    _ => Vec3::new(3.0, 4.0, 5.0),
                };
                let normal = [Vec3::ZERO, Vec3::Z, Vec3::NEG_X, unit().normalize()][round / 4 % 4];
                let count = [1, 20, 300, 4000, 12_000, 13_000][round % 6];
                let max_radius_m = [f32::INFINITY, 9.0, 40.0, 0.5, 0.0][round % 5];
                let step = [0.0, 1e-6, 0.01, 0.1, 1.0][round % 5];
                for i in 0..24 {
                    let mut point = from + step * unit();
                    if i % 8 < 3 {
                        // Photons themselves, and the same point again: ties.
                        point = from;
                    }
                    let bent = (normal + 0.2 * unit()).normalize();
                    let normal = if i % 5 == 4 && normal != Vec3::ZERO { bent } else { normal };
                    queries.push(Query { point, normal, count, max_radius_m });
                }
            }
            queries.push(Query { point: Vec3::NAN, ..queries[0] });
            queries.push(Query { count: 0, ..queries[1] });
            compare(&store, &queries);
        }
    }
}

#[test]
fn ties_are_cut_by_index_as_alone() {
    // Photons on a grid, queries at its points and between them: many at the same distance.
    let mut photons = photons(Shape::Cloud, 10_000);
    for (i, photon) in photons.iter_mut().enumerate() {
        photon.position = Vec3::new((i % 100) as f32, (i / 100 % 50) as f32, 0.0) * 0.25;
        photon.normal = Vec3::Z;
    }
    let built = Built::new(&photons, Size { page_photons: 700, ..PLAIN });
    let store = built.open(1 << 26, Access::Mapped);
    let mut queries = Vec::new();
    for count in [3, 50, 333, 2000] {
        for i in 0..400 {
            let point =
                Vec3::new(5.0 + (i % 20) as f32 * 0.125, 4.0 + (i / 20) as f32 * 0.125, 0.0);
            queries.push(Query { point, normal: Vec3::Z, count, max_radius_m: 7.0 });
        }
    }
    compare(&store, &queries);
}

#[test]
fn neighbours_share_their_walk() {
    let mut photons = photons(Shape::Cloud, 60_000);
    for photon in &mut photons {
        photon.position.z = 0.0;
        photon.normal = Vec3::Z;
    }
    let built = Built::new(&photons, Size { page_photons: 1000, ..PLAIN });
    let store = built.open(1 << 28, Access::Mapped);
    let queries: Vec<Query> = (0..4000)
        .map(|i| {
            let (x, y) = (i % 8 + i / 64 % 8 * 8, i / 8 % 8 + i / 512 * 8);
            let point = Vec3::new(-20.0 + 0.04 * x as f32, 0.04 * y as f32, 0.0);
            Query { point, normal: Vec3::Z, count: 400, max_radius_m: 10.0 }
        })
        .collect();
    let (alone, together) = compare(&store, &queries);
    assert!(together * 10 < alone, "{together} pages touched together, {alone} alone");
}
