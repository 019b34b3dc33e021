use super::super::scene::{CAMERA, HEIGHT, WIDTH, walking};
use super::*;
use crate::geometry::colour_image::ColourImage;
use nalgebra::{Translation3, UnitQuaternion, Vector3};
use pulp::Scalar;

/// A camera some way to a side of the depth camera, a little turned.
fn pose(side: f64) -> Isometry3<f64> {
    let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), 0.05 * side);
    Isometry3::from_parts(Translation3::new(-0.1 * side, 0.01, 0.0), turn)
}

/// The nearest solid at each pixel by its rays, 0 for none.
fn seen(solids: &[TaperedCylinder; SOLID_COUNT], pose: &Isometry3<f64>) -> Vec<u8> {
    let moved = solids.map(|solid| TaperedCylinder {
        start: pose.rotation * solid.start + pose.translation.vector,
        end: pose.rotation * solid.end + pose.translation.vector,
        dome: solid.dome.map(|dome| pose.rotation * dome),
        ..solid
    });
    let mut labels = vec![0; WIDTH * HEIGHT];
    for (pixel, label) in labels.iter_mut().enumerate() {
        let (i, j) = ((pixel % WIDTH) as f64, (pixel / WIDTH) as f64);
        let (x, y) = ((i - CAMERA.cx) / CAMERA.fx, (j - CAMERA.cy) / CAMERA.fy);
        let depths = moved.iter().enumerate().filter_map(|(k, solid)| Some((k, solid.depth_along(x, y)?)));
        *label = depths.min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(k, _)| k as u8 + 1);
    }
    labels
}

/// Each segment in a colour of its own with a texture, in front of grey.
fn painted(labels: &[u8]) -> ColourImage {
    let pixel = |(k, label): (usize, &u8)| {
        let texture = (k * 7919 % 40) as u8;
        let level = |bit: u8| if label >> bit & 1 == 1 { 200 + texture } else { 20 + texture };
        if *label == 0 { [110 + texture / 4; 3] } else { [level(0), level(1), level(2)] }
    };
    ColourImage { width: WIDTH, height: HEIGHT, pixels: labels.iter().enumerate().map(pixel).collect() }
}

fn cameras(solids: &[TaperedCylinder; SOLID_COUNT]) -> [SideCamera; 2] {
    [-1.0, 1.0].map(|side| {
        let labels = seen(solids, &pose(side));
        SideCamera { intrinsics: CAMERA, camera_from_sensor: pose(side), first: painted(&labels), labels }
    })
}

fn images(solids: &[TaperedCylinder; SOLID_COUNT]) -> SideImages {
    [-1.0, 1.0].map(|side| painted(&seen(solids, &pose(side))))
}

#[test]
fn regions_are_the_pixels_that_each_segment_shows() {
    let (_, _, solids) = walking(0.7);
    let cameras = cameras(&solids);
    let images = images(&solids);
    let templates = Templates::new(&cameras).expect("labels");
    let cue = templates.cue(&images);
    for (k, template) in templates.views.iter().enumerate() {
        let found = regions(Scalar::new(), &solids, template, &cue.sums[k]).expect("in front");
        let mut plain = [[0.0; BINS]; SOLID_COUNT];
        for (pixel, label) in cameras[k].labels.iter().enumerate().filter(|(_, label)| **label > 0) {
            add_pixel(&images[k], pixel % WIDTH, pixel / WIDTH, &mut plain[*label as usize - 1]);
        }
        for (segment, (found, plain)) in found.iter().zip(&plain).enumerate() {
            let pixels = |sums: &Sums| sums[..histogram::COLOURS].iter().sum::<f32>() / 3.0;
            // The order of middles is not that of pixels where two solids meet, at the knee and over the foot.
            assert!(
                (pixels(found) - pixels(plain)).abs() <= 0.12 * pixels(plain) + 12.0,
                "{segment}: {found:?} {plain:?}"
            );
        }
    }
}

#[test]
fn the_labelled_state_is_nearest_and_distance_grows_with_what_is_wrong() {
    let (_, _, solids) = walking(0.7);
    let templates = Templates::new(&cameras(&solids)).expect("labels");
    let cue = templates.cue(&images(&solids));
    let distance = |aside: f64| {
        let moved = solids.map(|solid| TaperedCylinder {
            start: solid.start + Vector3::new(aside, 0.0, 0.0),
            end: solid.end + Vector3::new(aside, 0.0, 0.0),
            ..solid
        });
        cue.distance(Scalar::new(), &moved).expect("in front")
    };
    let distances = [0.0, 0.02, 0.05, 0.12].map(distance);
    assert!(distances.windows(2).all(|pair| pair[0] < pair[1]), "{distances:?}");
    assert!(distances[0] < 0.5 && distances[3] < 4.0, "{distances:?}");
}

#[test]
fn labels_of_another_size_or_of_nothing_make_no_template() {
    let (_, _, solids) = walking(0.7);
    let mut cameras = cameras(&solids);
    cameras[0].labels.pop();
    assert!(Templates::new(&cameras).is_none());
    for camera in &mut cameras {
        camera.labels = vec![0; WIDTH * HEIGHT];
    }
    assert!(Templates::new(&cameras).is_none());
}
