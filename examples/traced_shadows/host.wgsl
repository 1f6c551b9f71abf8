// A program's own two passes: depth and normals, then light. What shoots shadow rays stands before this text.

struct Camera {
    clip_from_world: mat4x4f,
    world_from_clip: mat4x4f,
}

@group(0) @binding(0) var<uniform> camera: Camera;
@group(0) @binding(1) var depths: texture_depth_2d;
@group(0) @binding(2) var normals: texture_2d<f32>;

// The way the sun's light travels: SUN in host.rs.
const SUN = vec3f(0.5, -1.0, -0.7);
const SKY = vec3f(0.3, 0.5, 0.8);

struct Varyings {
    @builtin(position) position: vec4f,
    @location(0) normal: vec3f,
}

@vertex
fn corner(@location(0) position: vec3f, @location(1) normal: vec3f) -> Varyings {
    return Varyings(camera.clip_from_world * vec4f(position, 1.0), normal);
}

@fragment
fn surface(in: Varyings) -> @location(0) vec4f {
    return vec4f(normalize(in.normal), 1.0);
}

@vertex
fn screen(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
    return vec4f(f32(i & 1u) * 4.0 - 1.0, f32(i >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}

@fragment
fn light(@builtin(position) at: vec4f) -> @location(0) vec4f {
    let texel = vec2u(at.xy);
    let depth = textureLoad(depths, texel, 0);
    if depth == 0.0 {
        return vec4f(SKY, 1.0);
    }
    let ndc = at.xy / vec2f(textureDimensions(depths)) * vec2f(2.0, -2.0) + vec2f(-1.0, 1.0);
    let place = camera.world_from_clip * vec4f(ndc, depth, 1.0);
    let normal = textureLoad(normals, texel, 0).xyz;
    let lit = chiaro_light_visibility(0u, place.xyz / place.w, normal, at.xy);
    let sun = max(dot(normal, normalize(-SUN)), 0.0) * lit;
    return vec4f(vec3f(0.7, 0.65, 0.6) * (0.15 + 0.85 * sun), 1.0);
}
