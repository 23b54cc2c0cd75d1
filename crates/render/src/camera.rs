//! Where the picture is seen from.

use crate::{Options, Scene};
use topipe_mesh::DVec3;

/// An orthographic camera. It looks at the middle of the scene and shows all of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    /// Angle of the viewer around +z, from +x towards +y, degrees.
    pub azimuth: f64,
    /// Angle of the viewer above the xy plane, degrees.
    pub elevation: f64,
    /// Enlargement; 1 shows the whole scene.
    pub zoom: f64,
    /// The point in the middle of the picture; the middle of the scene where it is `None`.
    pub target: Option<DVec3>,
}

/// A camera fitted to a scene: maps points to samples.
///
/// Coordinates are in samples: x to the right, y down, z towards the viewer.
#[derive(Debug, Clone)]
pub(crate) struct Projection {
    axes: [DVec3; 3],
    center: DVec3,
    /// Samples per millimetre.
    pub(crate) scale: f64,
    /// Samples across and down.
    pub(crate) size: [usize; 2],
    /// Samples per pixel along each axis.
    pub(crate) supersampling: usize,
    /// Reach of the ambient occlusion in samples.
    pub(crate) occlusion_reach: f64,
}

impl Camera {
    /// From the right, the front and above.
    pub const ISO: Self = Self::new(-60.0, 30.0);
    /// From the left, the back and above.
    pub const ISO_BACK: Self = Self::new(120.0, 30.0);
    /// Along +y.
    pub const FRONT: Self = Self::new(-90.0, 0.0);
    /// Along -y.
    pub const BACK: Self = Self::new(90.0, 0.0);
    /// Along -x.
    pub const RIGHT: Self = Self::new(0.0, 0.0);
    /// Along +x.
    pub const LEFT: Self = Self::new(180.0, 0.0);
    /// Along -z, +y up.
    pub const TOP: Self = Self::new(-90.0, 90.0);
    /// Along +z.
    pub const BOTTOM: Self = Self::new(-90.0, -90.0);

    /// A camera at the given angles, in degrees.
    pub const fn new(azimuth: f64, elevation: f64) -> Self {
        Self { azimuth, elevation, zoom: 1.0, target: None }
    }

    /// The preset of that name: iso, iso-back, front, back, left, right, top or bottom.
    pub fn preset(name: &str) -> Option<Self> {
        Some(match name {
            "iso" => Self::ISO,
            "iso-back" => Self::ISO_BACK,
            "front" => Self::FRONT,
            "back" => Self::BACK,
            "right" => Self::RIGHT,
            "left" => Self::LEFT,
            "top" => Self::TOP,
            "bottom" => Self::BOTTOM,
            _ => return None,
        })
    }

    /// The same camera, nearer by `zoom` and looking at `target`.
    pub const fn close_up(self, target: DVec3, zoom: f64) -> Self {
        Self { zoom, target: Some(target), ..self }
    }

    /// Right, up, and towards the viewer: orthonormal at every angle, poles included.
    fn axes(&self) -> [DVec3; 3] {
        let (sin_a, cos_a) = self.azimuth.to_radians().sin_cos();
        let (sin_e, cos_e) = self.elevation.to_radians().sin_cos();
        [
            DVec3::new(-sin_a, cos_a, 0.0),
            DVec3::new(-sin_e * cos_a, -sin_e * sin_a, cos_e),
            DVec3::new(cos_e * cos_a, cos_e * sin_a, sin_e),
        ]
    }

    pub(crate) fn project(&self, scene: &Scene<'_>, options: &Options) -> Projection {
        let axes = self.axes();
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let (mut world_low, mut world_high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for p in scene.points().filter(|p| p.is_finite()) {
            let q = DVec3::new(axes[0].dot(p), axes[1].dot(p), axes[2].dot(p));
            (low, high) = (low.min(q), high.max(q));
            (world_low, world_high) = (world_low.min(p), world_high.max(p));
        }
        if !low.is_finite() {
            (low, high, world_low, world_high) = (DVec3::ZERO, DVec3::ZERO, DVec3::ZERO, DVec3::ZERO);
        }
        let middle = (low + high) / 2.0;
        let center =
            self.target.unwrap_or_else(|| axes[0] * middle.x + axes[1] * middle.y + axes[2] * middle.z);
        let size = [options.width * options.supersampling, options.height * options.supersampling];
        let room = (1.0 - 2.0 * options.margin).clamp(0.05, 1.0);
        let extent = high - low;
        let fit = (size[0] as f64 / extent.x).min(size[1] as f64 / extent.y) * room * self.zoom;
        // A scene without extent (empty, or one point) is shown at one sample a millimetre.
        let scale = if fit.is_finite() && fit > 0.0 { fit } else { 1.0 };
        let occlusion_reach = options.occlusion_reach * (world_high - world_low).length() * scale;
        Projection { axes, center, scale, size, supersampling: options.supersampling, occlusion_reach }
    }
}

impl Projection {
    /// The sample coordinates of a point.
    pub(crate) fn point(&self, p: DVec3) -> DVec3 {
        let d = self.direction(p - self.center) * self.scale;
        DVec3::new(self.size[0] as f64 / 2.0 + d.x, self.size[1] as f64 / 2.0 - d.y, d.z)
    }

    /// A direction in view coordinates: x to the right, y up, z towards the viewer.
    pub(crate) fn direction(&self, d: DVec3) -> DVec3 {
        DVec3::new(self.axes[0].dot(d), self.axes[1].dot(d), self.axes[2].dot(d))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_are_orthonormal_and_right_handed() {
        for (azimuth, elevation) in [(0.0, 0.0), (-60.0, 30.0), (123.0, 90.0), (-90.0, -90.0)] {
            let [x, y, z] = Camera::new(azimuth, elevation).axes();
            assert!((x.cross(y) - z).length() < 1e-15);
            assert!((x.length() - 1.0).abs() < 1e-15 && (y.length() - 1.0).abs() < 1e-15);
        }
    }

    #[test]
    fn presets_look_the_way_their_names_say() {
        assert!((Camera::FRONT.axes()[2] - DVec3::NEG_Y).length() < 1e-15);
        assert!((Camera::TOP.axes()[2] - DVec3::Z).length() < 1e-15);
        assert!((Camera::TOP.axes()[1] - DVec3::Y).length() < 1e-15);
        assert!((Camera::RIGHT.axes()[2] - DVec3::X).length() < 1e-15);
        assert!(Camera::preset("iso-back").is_some() && Camera::preset("under").is_none());
    }
}
