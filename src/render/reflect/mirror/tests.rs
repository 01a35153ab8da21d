use glam::DVec3;

use super::rule::{MirrorReceiver, MirrorRule, SEPARATION_DEG};
use super::suns::MirrorTimes;
use crate::base::Silent;
use crate::site::{Face, Material, Object, PvSurface, Site, Triangle};
use crate::sky::{Place, SunModel};

/// Quads, the first of them PV.
pub(super) fn site(quads: &[[DVec3; 4]]) -> Site {
    let mut triangles = Vec::new();
    let mut faces = Vec::new();
    for (i, corners) in quads.iter().enumerate() {
        for [a, b, c] in [[0, 1, 2], [0, 2, 3]] {
            let corners = [corners[a], corners[b], corners[c]].map(DVec3::as_vec3);
            triangles.push(Triangle { corners, face: i as u32 });
        }
        faces.push(Face { object: 0, material: 0, pv: (i == 0).then_some(0) });
    }
    let [a, b, _, d] = quads[0];
    let across = (b - a).cross(d - a);
    let pv = PvSurface {
        name: "pv".into(),
        entry: 0,
        triangles: vec![0, 1],
        normal: across.normalize(),
        area_m2: across.length(),
        two_sided: false,
    };
    Site::from_parts(
        triangles,
        faces,
        vec![Object { id: String::new(), kind: String::new() }],
        vec![Material { name: "m".into(), reflectance: [0.2; 3], diffuse: true }],
        vec![pv],
        DVec3::ZERO,
        Vec::new(),
    )
}

/// 12 x 12 m around (0, 0, 10), sloping 27 % to the west.
pub(super) fn roof() -> [DVec3; 4] {
    let normal = DVec3::new(-0.27, 0.0, 1.0).normalize();
    let x = DVec3::new(1.0, 0.0, 0.27).normalize() * 6.0;
    let y = normal.cross(x.normalize()) * 6.0;
    let o = DVec3::new(0.0, 0.0, 10.0);
    [o - x - y, o + x - y, o + x + y, o - x + y]
}

pub(super) fn times() -> MirrorTimes {
    MirrorTimes {
        place: Place {
            latitude_deg: 47.038,
            longitude_deg: 8.312,
            meridian_deg: 15.0,
            elevation_m: 0.0,
        },
        model: SunModel::Gensky,
        year: 2025,
        step_s: 60,
        refraction: false,
        horizon: None,
    }
}

pub(super) fn receiver(distance_m: f64, azimuth_deg: f64, height_m: f64) -> MirrorReceiver {
    let a = azimuth_deg.to_radians();
    let position = DVec3::new(distance_m * libm::sin(a), distance_m * libm::cos(a), height_m);
    MirrorReceiver { position, normal: None }
}

#[test]
fn the_numbers_that_were_computed_elsewhere() {
    let site = site(&[roof()]);
    let rule = MirrorRule::new(&site, times(), SEPARATION_DEG).expect("a rule");
    let cases = [
        (receiver(30.0, 270.0, 11.0), 69.0, 41.0, 117, 225, Some((7.70, 8.92))),
        (receiver(30.0, 275.0, 14.0), 86.4, 51.0, 117, 225, Some((8.17, 9.50))),
        (receiver(60.0, 270.0, 14.0), 22.9, 22.0, 136, 206, Some((8.00, 8.58))),
        (receiver(60.0, 265.0, 14.0), 2.9, 9.0, 156, 186, None),
    ];
    for (at, hours, most, first, last, clock) in cases {
        let years = rule.years(&[at], &Silent).expect("runs");
        let s = years[0].summary();
        println!("{s:?}");
        assert_eq!((s.hours * 10.0).round() / 10.0, hours);
        assert_eq!((s.most_minutes, s.first_day, s.last_day), (most, first, last));
        if let Some((from, to)) = clock {
            assert_eq!((s.earliest_h * 100.0).round() / 100.0, from);
            assert_eq!((s.latest_h * 100.0).round() / 100.0, to);
        }
    }
}

#[test]
fn what_stands_in_the_way_counts_on_both_sides() {
    let at = receiver(30.0, 270.0, 11.0);
    let minutes = |more: &[[DVec3; 4]], separation: f64| {
        let quads: Vec<_> = std::iter::once(roof()).chain(more.iter().copied()).collect();
        let site = site(&quads);
        let rule = MirrorRule::new(&site, times(), separation).expect("a rule");
        rule.years(&[at], &Silent).expect("runs")[0].lit.len()
    };
    let wall = |x: f64, low: f64, high: f64| {
        [
            DVec3::new(x, -50.0, low),
            DVec3::new(x, 50.0, low),
            DVec3::new(x, 50.0, high),
            DVec3::new(x, -50.0, high),
        ]
    };
    let free = minutes(&[], 10.0);
    assert!(free > 4000);
    assert_eq!(minutes(&[wall(-20.0, 0.0, 20.0)], 10.0), 0, "before the receiver");
    assert_eq!(minutes(&[wall(30.0, 0.0, 60.0)], 10.0), 0, "before the sun");
    assert_eq!(minutes(&[wall(30.0, 0.0, 12.0)], 10.0), free, "below both");
    assert_eq!(minutes(&[wall(-31.0, 0.0, 20.0)], 10.0), free, "behind the receiver");
    // Sun and reflection are some 30 degrees apart here.
    assert_eq!(minutes(&[], 0.0), free);
    assert_eq!(minutes(&[], 60.0), 0);
    let some = minutes(&[], 31.0);
    assert!(some > 0 && some < free, "{some} of {free}");
}

#[test]
fn a_surface_sees_only_what_lies_before_it() {
    let site = site(&[roof()]);
    let rule = MirrorRule::new(&site, times(), SEPARATION_DEG).expect("a rule");
    let at = |normal| MirrorReceiver { normal: Some(normal), ..receiver(30.0, 270.0, 11.0) };
    let years = rule.years(&[at(DVec3::X), at(DVec3::NEG_X)], &Silent).expect("runs");
    assert!(years[0].lit.len() > 4000 && years[1].lit.is_empty());
}

#[test]
fn finer_steps_agree_with_coarse_ones_and_wrong_ones_are_refused() {
    let site = site(&[roof()]);
    let at = [receiver(30.0, 275.0, 14.0)];
    let hours = |step_s| {
        let rule = MirrorRule::new(&site, MirrorTimes { step_s, ..times() }, 10.0)?;
        Ok::<_, crate::render::view::error::Error>(rule.years(&at, &Silent)?[0].summary().hours)
    };
    let minute = hours(60).expect("runs");
    for step_s in [30, 120, 300] {
        let other = hours(step_s).expect("runs");
        assert!((other - minute).abs() < 0.02 * minute, "{other} at {step_s} s, {minute}");
    }
    for step_s in [0, 7, 86_400] {
        assert!(hours(step_s).is_err(), "{step_s}");
    }
}
