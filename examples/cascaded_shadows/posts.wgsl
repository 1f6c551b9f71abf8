// A floor and posts on it, as a light or the camera sees them. What looks shadows up stands before this text.

@group(0) @binding(0) var<uniform> clip_from_world: mat4x4f;

// The way the sun's light travels: SUN in posts.rs.
const SUN = vec3f(0.6, -1.0, -0.4);

struct Varyings {
    @builtin(position) position: vec4f,
    @location(0) position_ws: vec3f,
    @location(1) normal_ws: vec3f,
}

@vertex
fn vertex(@location(0) position: vec3f, @location(1) normal: vec3f) -> Varyings {
    return Varyings(clip_from_world * vec4f(position, 1.0), position, normal);
}

@fragment
fn fragment(in: Varyings) -> @location(0) vec4f {
    let lit = chiaro_light_visibility(0u, in.position_ws, in.normal_ws, in.position.xy);
    let sun = max(dot(in.normal_ws, normalize(-SUN)), 0.0) * lit;
    return vec4f(vec3f(0.7, 0.65, 0.6) * (0.15 + 0.85 * sun), 1.0);
}
