//! What VPLs see, by their maps.

use super::*;
use chiaro_testkit::device;

/// Places of a wall that a VPL looks at.
fn grid(z: f32, half: f32, count: u32) -> Vec<Place> {
    let axis = |i: u32| half * (2.0 * (i as f32 + 0.5) / count as f32 - 1.0);
    let places = (0..count).flat_map(|y| (0..count).map(move |x| (x, y)));
    places.map(|(x, y)| Place { position_ws: Vec3::new(axis(x), axis(y), z), vpl: 0 }).collect()
}

#[test]
fn experiment() {
    let gpu = device();
    for side in [IsmResolution::Side64, IsmResolution::Side128] {
        for points_per_vpl in [2000, 8000] {
            for push_threshold in [0.0, 0.2] {
                for levels in [0, 1, 2, 3] {
                    let plate = [Vec3::new(0.0, 0.0, 0.0), 0.3 * Vec3::X, 0.3 * Vec3::Y];
                    let open = scatter(&walls(), points_per_vpl, 1);
                    let blocked = scatter(&[walls(), vec![plate]].concat(), points_per_vpl, 1);
                    let vpls = [vpl(Vec3::new(0.0, 0.0, -1.0), Vec3::Z, 0)];
                    let settings = IndirectSettings {
                        points_per_vpl: points_per_vpl as u32,
                        push_threshold,
                        ..settings(side, levels)
                    };
                    let rig = Rig::new(&gpu, settings.clone(), (&open.0, open.1, 3.5), &vpls);
                    let mut places = grid(1.0, 1.0, 100);
                    for place in grid(1.0, 1.0, 100) {
                        let p = place.position_ws;
                        places.push(Place { position_ws: Vec3::new(1.0, p.x, p.y), vpl: 0 });
                    }
                    let seen = rig.visibility(&places, false);
                    let lost = |part: &[f32]| 1.0 - part.iter().sum::<f32>() / part.len() as f32;
                    let (front, aside) = (lost(&seen[..10000]), lost(&seen[10000..]));
                    let rig = Rig::new(&gpu, settings, (&blocked.0, blocked.1, 3.5), &vpls);
                    let seen = rig.visibility(&grid(1.0, 1.0, 200), false);
                    // The plate's shadow is twice as large: ±0.6.
                    let (mut inside, mut dark, mut leak, mut all) = (0, 0, 0, 0.0);
                    for (place, seen) in grid(1.0, 1.0, 200).iter().zip(&seen) {
                        let far = place.position_ws.x.abs().max(place.position_ws.y.abs());
                        if far < 0.6 {
                            inside += 1;
                            leak += usize::from(*seen > 0.5);
                        } else {
                            dark += usize::from(*seen < 0.5);
                        }
                        all += 1.0;
                    }
                    eprintln!(
                        "{}² {points_per_vpl} points push {push_threshold} levels {levels}: open room lost {front:.4} {aside:.4}; plate leaks {:.3}, shadow area {:.3} of truth",
                        side.texels(),
                        leak as f32 / inside as f32,
                        ((inside - leak + dark) as f32) / (0.36 * all)
                    );
                }
            }
        }
    }
}
