//! The depth image of solids, pixel by pixel with a depth buffer: the plain form of the projection that cue 2 compares
//! (\[walker\], section 4.4.2), for pictures and as what the fast form is checked against.
//!
//! The paper circumscribes each cylinder with polygons and rasterises them; here the solids themselves are met by the
//! pixels' rays.

use crate::geometry::camera::{DepthMap, Intrinsics};
use crate::geometry::tapered_cylinder::TaperedCylinder;

/// Depth of the nearest solid at each pixel's centre, metres; 0 where there is none.
pub fn render(solids: &[TaperedCylinder], camera: &Intrinsics, width: usize, height: usize) -> DepthMap {
    let mut map = DepthMap::empty(width, height);
    for solid in solids {
        for j in 0..height {
            for i in 0..width {
                let (x, y) = ((i as f64 - camera.cx) / camera.fx, (j as f64 - camera.cy) / camera.fy);
                let nearest = &mut map.depth[j * width + i];
                if let Some(z) = solid.depth_along(x, y).map(|z| z as f32)
                    && (*nearest == 0.0 || z < *nearest)
                {
                    *nearest = z;
                }
            }
        }
    }
    map
}
