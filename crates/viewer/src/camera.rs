//! Flying: keys push, the mouse turns.

use chiaro::View;
use glam::{Mat4, Quat, Vec2, Vec3};

/// What the user does to the camera in one frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Steering {
    /// Right, up, back: −1..1 each.
    pub push: Vec3,
    /// Turn of the mouse in window points, right and down.
    pub turn: Vec2,
}

/// Radians per window point.
const TURN_RAD: f32 = 0.003;
/// Seconds in which speed reaches 63 % of what keys ask for.
const INERTIA_S: f32 = 0.06;
/// Just short of straight up or down, where there is no horizon.
const MAX_PITCH_RAD: f32 = 1.55;

/// A camera that flies freely, its horizon level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlyCamera {
    view: View,
    yaw_rad: f32,
    pitch_rad: f32,
    velocity: Vec3,
}

impl FlyCamera {
    /// Starts from a view; its roll is lost at the first turn.
    pub fn new(view: View) -> Self {
        let forward = view.forward_ws();
        Self {
            view,
            yaw_rad: (-forward.x).atan2(-forward.z),
            pitch_rad: forward.y.clamp(-1.0, 1.0).asin().clamp(-MAX_PITCH_RAD, MAX_PITCH_RAD),
            velocity: Vec3::ZERO,
        }
    }

    /// What it sees.
    pub fn view(&self) -> View {
        self.view
    }

    /// Lets `dt_s` pass. `speed` is in metres per second at full push.
    pub fn steer(&mut self, steering: Steering, speed: f32, dt_s: f32) {
        if steering.turn != Vec2::ZERO {
            self.yaw_rad = (self.yaw_rad - steering.turn.x * TURN_RAD) % std::f32::consts::TAU;
            self.pitch_rad =
                (self.pitch_rad - steering.turn.y * TURN_RAD).clamp(-MAX_PITCH_RAD, MAX_PITCH_RAD);
            let turn = Quat::from_rotation_y(self.yaw_rad) * Quat::from_rotation_x(self.pitch_rad);
            self.view.world_from_camera = Mat4::from_rotation_translation(turn, self.view.eye_ws());
        }
        let wanted = steering.push.clamp_length_max(1.0) * speed;
        // The exact solution of v' = (wanted − v) / τ, so that the path does not depend on the frame rate.
        let kept = (-dt_s / INERTIA_S).exp();
        let moved = wanted * dt_s + (self.velocity - wanted) * INERTIA_S * (1.0 - kept);
        self.velocity = wanted + (self.velocity - wanted) * kept;
        if wanted == Vec3::ZERO && self.velocity.length() < 0.01 * speed {
            // A camera that creeps would never let the picture come to rest.
            self.velocity = Vec3::ZERO;
            return;
        }
        let axes = self.view.world_from_camera;
        let path = axes.x_axis * moved.x + axes.z_axis * moved.z;
        // Up is the world's: a diver's view down does not turn it.
        let eye = self.view.eye_ws() + path.truncate() + Vec3::Y * moved.y;
        if eye.is_finite() {
            self.view.world_from_camera.w_axis = eye.extend(1.0);
        }
    }

    /// Whether it still moves by itself.
    pub fn is_moving(&self) -> bool {
        self.velocity != Vec3::ZERO
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera() -> FlyCamera {
        FlyCamera::new(View::look_at(Vec3::new(1.0, 2.0, 3.0), Vec3::new(4.0, 1.0, -2.0), 1.0, 0.1))
    }

    #[test]
    fn taking_over_changes_nothing_and_a_turn_keeps_the_place() {
        let mut camera = camera();
        let before = camera.view();
        camera.steer(Steering::default(), 1.0, 0.016);
        assert_eq!(camera.view(), before);
        camera.steer(Steering { turn: Vec2::new(1e-4, 0.0), ..Steering::default() }, 1.0, 0.016);
        assert!(camera.view().world_from_camera.abs_diff_eq(before.world_from_camera, 1e-4));
    }

    #[test]
    fn the_way_flown_does_not_depend_on_the_frame_rate() {
        let fly = |frames: u32| {
            let mut camera = camera();
            let push = Steering { push: Vec3::NEG_Z, ..Steering::default() };
            (0..frames).for_each(|_| camera.steer(push, 2.0, 1.0 / frames as f32));
            camera.view().eye_ws()
        };
        let (slow, fast) = (fly(10), fly(500));
        assert!(slow.distance(fast) < 1e-3, "{slow} {fast}");
        // One second at 2 m/s less what inertia takes.
        assert!((camera().view().eye_ws().distance(slow) - 2.0 * (1.0 - INERTIA_S)).abs() < 1e-3);
    }

    #[test]
    fn it_comes_to_rest() {
        let mut camera = camera();
        camera.steer(Steering { push: Vec3::X, ..Steering::default() }, 2.0, 0.1);
        assert!(camera.is_moving());
        (0..100).for_each(|_| camera.steer(Steering::default(), 2.0, 0.016));
        assert!(!camera.is_moving());
    }
}
