//! Photons of a range of timesteps, held against a filter over all photons.

use super::{BOUNDS, Built, PLAIN, SHAPES, Shape, all, photons};
use crate::base::{Aabb, Photon, Purpose, Stream};
use crate::pages::build::Size;
use crate::pages::{Access, Light};

#[test]
fn a_range_of_timesteps_gives_what_a_filter_gives() {
    for shape in SHAPES {
        let photons = photons(shape, 6000);
        let built = Built::new(&photons, Size { page_photons: 500, ..PLAIN });
        let store = built.open(1 << 24, Access::Mapped);
        let all = all(&store);
        let mut random = Stream::new(5, Purpose::Survey, 0);
        // Nothing, one, few, half, all, and beyond the end.
        for (start, end) in
            [(7, 7), (100, 101), (2000, 2064), (3000, 6000), (0, 6000), (5990, 9999)]
        {
            let during: Vec<(u64, Photon)> =
                all.iter().filter(|(_, p)| (start..end).contains(&p.timestep)).copied().collect();
            for round in 0..12 {
                let point = photons[round * 101].position + random.uniform() as f32;
                let region = Aabb { min: point - 9.0, max: point + 4.0 };
                let mut lit = Vec::new();
                store
                    .lit_in_box(region, &(start..end), |i, place, normal, light| {
                        lit.push((i, place, normal, light.timestep));
                        true
                    })
                    .expect("reads");
                let inside = during.iter().filter(|(_, p)| region.contains(p.position));
                let inside = inside.map(|(i, p)| (*i, p.position, p.normal, p.timestep));
                assert!(lit == inside.collect::<Vec<_>>(), "{shape:?} {start}..{end} {region:?}");
            }
        }
    }
}

#[test]
fn pages_without_the_timesteps_are_decoded_once_only() {
    // The sun wanders over the scene: each place has its hours.
    let mut photons = photons(Shape::Cloud, 20_000);
    for photon in &mut photons {
        photon.timestep = ((photon.position.x + 50.0) * 100.0) as u32;
    }
    let built = Built::new(&photons, Size { page_photons: 200, ..PLAIN });
    let store = built.open(0, Access::Mapped);
    let read = || {
        let before = store.cache_stats().misses;
        let mut count = 0;
        let each = |_, _, _, _: &Light| {
            count += 1;
            true
        };
        store.lit_in_box(BOUNDS, &(1000..1500), each).expect("reads");
        (store.cache_stats().misses - before, count)
    };
    let (first, count) = read();
    let (second, again) = read();
    assert_eq!((first, count), (store.info().pages, again));
    assert!(count > 500 && second * 4 < first, "{first} pages decoded, then {second}");
}
