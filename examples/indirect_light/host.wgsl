// A program's own two passes: depth, normals and albedo, then light.

struct Frame {
    clip_from_world: mat4x4f,
    world_from_clip: mat4x4f,
    lamp_place: vec3f,
    candela: f32,
    lamp_direction: vec3f,
    // Cosines of the angles within which it is brightest, and dark beyond.
    inner: f32,
    outer: f32,
}

@group(0) @binding(0) var<uniform> frame: Frame;
@group(1) @binding(0) var depths: texture_depth_2d;
@group(1) @binding(1) var normals: texture_2d<f32>;
@group(1) @binding(2) var albedos: texture_2d<f32>;
// Nits.
@group(1) @binding(3) var indirect: texture_2d<f32>;

const INVERSE_PI = 0.31830989;
// Nits that are shown as 1 − 1/e of white.
const EXPOSED = 12.0;

struct Varyings {
    @builtin(position) position: vec4f,
    @location(0) normal: vec3f,
    @location(1) albedo: vec3f,
}

@vertex
fn corner(@location(0) position: vec3f, @location(1) normal: vec3f, @location(2) albedo: vec3f) -> Varyings {
    return Varyings(frame.clip_from_world * vec4f(position, 1.0), normal, albedo);
}

struct Surface {
    @location(0) normal: vec4f,
    @location(1) albedo: vec4f,
}

@fragment
fn surface(in: Varyings) -> Surface {
    return Surface(vec4f(normalize(in.normal), 0.0), vec4f(in.albedo, 1.0));
}

@vertex
fn screen(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
    return vec4f(f32(i & 1u) * 4.0 - 1.0, f32(i >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}

@fragment
fn shade(@builtin(position) at: vec4f) -> @location(0) vec4f {
    let texel = vec2u(at.xy);
    let depth = textureLoad(depths, texel, 0);
    if depth == 1.0 {
        return vec4f(0.0, 0.0, 0.0, 1.0);
    }
    let ndc = at.xy / vec2f(textureDimensions(depths)) * vec2f(2.0, -2.0) + vec2f(-1.0, 1.0);
    let place = frame.world_from_clip * vec4f(ndc, depth, 1.0);
    let to_lamp = frame.lamp_place - place.xyz / place.w;
    let direction = normalize(to_lamp);
    let cone = clamp((dot(-direction, frame.lamp_direction) - frame.outer) / (frame.inner - frame.outer), 0.0, 1.0);
    let facing = max(dot(textureLoad(normals, texel, 0).xyz, direction), 0.0);
    let lux = frame.candela * cone * cone * facing / dot(to_lamp, to_lamp);
    let nits = textureLoad(albedos, texel, 0).rgb * lux * INVERSE_PI + textureLoad(indirect, texel, 0).rgb;
    return vec4f(1.0 - exp(-nits / EXPOSED), 1.0);
}
