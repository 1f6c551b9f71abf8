//! All settings of all techniques, by key.

use std::sync::LazyLock;

use chiaro_gpu::Gpu;
use chiaro_techniques::caustics::CausticsSettings;
use chiaro_techniques::choice;
use chiaro_techniques::environment::EnvironmentSettings;
use chiaro_techniques::indirect::points::PointOptions;
use chiaro_techniques::indirect::{IndirectSettings, Technique};
use chiaro_techniques::post::{Aov, CameraSettings, PostSettings, Smoothing};
use chiaro_techniques::settings::{Clause, Condition, Effect, Field, SettingsGroup, Value};
use chiaro_techniques::shadow::{Layout, ShadowSettings};
use chiaro_techniques::specular::{SpecularSettings, SpecularTechnique};
use chiaro_techniques::view::raster::ComputeRaster;
use chiaro_techniques::view::{Raster, SurfaceSettings};

use crate::Error;

choice! {
    /// Which frame function renders.
    pub enum Pipeline {
        /// A surface buffer, then lighting in compute; accumulated samples smooth edges.
        Deferred = "deferred",
        /// Lighting in fragments; multisampling smooths edges.
        Forward = "forward",
    }
}

#[expect(clippy::derivable_impls, reason = "variants of a choice take no attributes")]
impl Default for Pipeline {
    fn default() -> Self {
        Self::Deferred
    }
}

/// The key of [`Settings::pipeline`], which is no technique's.
const PIPELINE: &str = "pipeline";

/// Declares [`Settings`]: one line a group is all that presets, command line and viewer need to have it.
macro_rules! groups {
    ($($(#[doc = $doc:literal])+ $name:ident: $group:ty;)+) => {
        /// Every technique's settings.
        #[derive(Clone, Debug, Default, PartialEq)]
        pub struct Settings {
            /// `pipeline`: frame function.
            pub pipeline: Pipeline,
            /// What all random choices start from, where virtual lights are put for one; the same seed and settings give the
            /// same image.
            pub seed: u32,
            $($(#[doc = $doc])+ pub $name: $group),+
        }

        impl Settings {
            fn described() -> Vec<Field> {
                let pipeline = Field {
                    key: PIPELINE.into(),
                    meaning: "How surfaces meet light: shaded once a pixel in compute, or while they are drawn.".into(),
                    unit: "",
                    kind: Pipeline::kind(&()),
                    default: Pipeline::default().show(),
                    effect: Effect::Permutation,
                    only: None,
                };
                [vec![pipeline], $(<$group>::fields()),+].concat()
            }

            /// The value of a key, as text.
            pub fn get(&self, key: &str) -> Option<String> {
                match key.split_once('.') {
                    None => (key == PIPELINE).then(|| self.pipeline.show()),
                    $(Some((<$group as SettingsGroup>::GROUP, name)) => self.$name.get(name),)+
                    Some(_) => None,
                }
            }

            fn set_text(&mut self, key: &str, value: &str) -> Option<Result<(), String>> {
                match key.split_once('.') {
                    None if key == PIPELINE => {
                        Some(Pipeline::parse(value, &()).map(|pipeline| self.pipeline = pipeline))
                    }
                    $(Some((<$group as SettingsGroup>::GROUP, name)) => self.$name.set(name, value),)+
                    _ => None,
                }
            }
        }
    };
}

groups! {
    /// `camera.*`
    camera: CameraSettings;
    /// `surface.*`
    surface: SurfaceSettings;
    /// `shadow.*`
    shadow: ShadowSettings;
    /// `environment.*`
    environment: EnvironmentSettings;
    /// `indirect.*`
    indirect: IndirectSettings;
    /// `caustics.*`
    caustics: CausticsSettings;
    /// `specular.*`
    specular: SpecularSettings;
    /// `post.*`
    post: PostSettings;
}

/// Presets by name: a sentence and the keys they set.
const PRESETS: [(&str, &str, &[(&str, &str)]); 6] = [
    ("default", "what chiaro thinks looks right", &[]),
    (
        "direct",
        "the light of lamps alone; sky and environment are seen, straight and in metals, but light nothing",
        &[("indirect.technique", "none"), ("caustics.technique", "none")],
    ),
    (
        "fast",
        "for weak GPUs: smaller shadow maps, one-tap filter, fewer points in smaller reflective and imperfect maps",
        &[
            ("shadow.resolution", "1024"),
            ("shadow.pcf_kernel", "2"),
            ("surface.anisotropy", "4"),
            ("surface.msaa", "1"),
            ("indirect.vpls", "1024"),
            ("indirect.rsm_resolution", "256"),
            ("indirect.ism_resolution", "64"),
            ("indirect.points_per_vpl", "2000"),
        ],
    ),
    (
        "high",
        "for fast GPUs and stills: four times as many virtual lights",
        &[("indirect.vpls", "4096"), ("indirect.ism_resolution", "128"), ("indirect.points_per_vpl", "8000")],
    ),
    (
        "thesis-indirect",
        "the global illumination thesis' own choices: 1,024 virtual lights by Halton, maps of 128² and 8,000 points, \
         two levels of pull-push, 4×4 interleaved, a discontinuity buffer",
        &[
            ("surface.lighting", "lambert"),
            ("indirect.technique", "ism"),
            ("indirect.vpls", "1024"),
            ("indirect.sampling", "halton"),
            ("indirect.rsm_resolution", "512"),
            ("indirect.ism_resolution", "128"),
            ("indirect.points_per_vpl", "8000"),
            ("indirect.pull_push.levels", "2"),
            ("indirect.interleave", "4"),
            ("indirect.filter", "discontinuity"),
            ("indirect.filter_width", "5"),
            ("caustics.technique", "none"),
        ],
    ),
    (
        "thesis-shadows",
        "the shadow thesis' own choices: ambient and diffuse light, variance maps of back faces, a blur of five taps, \
         colours darkened to 0.3",
        &[
            ("surface.lighting", "lambert"),
            ("surface.anisotropy", "16"),
            ("indirect.technique", "ambient"),
            ("caustics.technique", "none"),
            ("shadow.representation", "variance"),
            ("shadow.filter", "gaussian-mip"),
            ("shadow.filter_radius", "2"),
            // The middle five of row 12 of Pascal's triangle, to within 0.0003.
            ("shadow.sigma", "1.79"),
            ("shadow.anisotropy", "16"),
            ("shadow.min_variance", "0.00002"),
            ("shadow.pcf_kernel", "4"),
            ("shadow.exponent", "80"),
            ("shadow.darkens", "thesis"),
            ("shadow.floor", "0.3"),
            ("shadow.cascade_select", "depth"),
            ("shadow.split_lambda", "0.5"),
            ("shadow.blend", "0"),
            ("shadow.bias.receiver_plane", "false"),
            ("shadow.bias.cull_front", "true"),
        ],
    ),
];

impl Settings {
    /// Every setting there is, described.
    pub fn fields() -> &'static [Field] {
        static FIELDS: LazyLock<Vec<Field>> = LazyLock::new(Settings::described);
        &FIELDS
    }

    /// Sets a key from text.
    ///
    /// # Errors
    /// [`Error::UnknownSetting`] with the nearest keys, [`Error::SettingValue`] with what is allowed.
    pub fn set(&mut self, key: &str, value: &str) -> Result<(), Error> {
        let unknown = || Error::UnknownSetting { key: key.into(), nearest: nearest(key) };
        let wrong = |expected| Error::SettingValue { key: key.into(), value: value.into(), expected };
        self.set_text(key, value).ok_or_else(unknown)?.map_err(wrong)
    }

    /// Why a key does nothing beside the others: the condition that it, or a key of its condition, does not meet. `None`
    /// where it matters.
    pub fn idle(&self, key: &str) -> Option<Condition> {
        self.unmet(Self::fields().iter().find(|field| field.key == key)?.only?)
    }

    /// Why a quantity is black with these settings: the condition that it, or a key of its condition, does not meet. `None`
    /// where there is something to see.
    pub fn blackens(&self, aov: Aov) -> Option<Condition> {
        self.unmet(aov.only()?)
    }

    fn unmet(&self, only: Condition) -> Option<Condition> {
        let mut reasons = Vec::new();
        let mut meets = |clause: Clause| {
            let value = self.get(clause.key).unwrap_or_default();
            let is_met = clause.values.contains(&value.as_str()) == clause.has;
            let reason = if is_met { self.idle(clause.key) } else { Some(only) };
            reasons.extend(reason);
            reason.is_none()
        };
        if only.alternatives().any(|all| all.into_iter().all(&mut meets)) {
            return None;
        }
        reasons.iter().find(|reason| **reason == only).or(reasons.first()).copied()
    }

    /// These settings with all that does nothing at its default, so that it neither compiles nor refuses anything.
    #[must_use]
    pub fn effective(&self) -> Self {
        let mut settings = self.clone();
        #[cfg(test)]
        if LITERALLY.get() {
            return settings;
        }
        for field in Self::fields().iter().filter(|field| self.idle(&field.key).is_some()) {
            // A default is in its range.
            let _ = settings.set(&field.key, &field.default);
        }
        settings
    }

    /// Whether frames of moving pictures are averaged over time.
    pub fn smooths(&self) -> bool {
        self.post.antialias == Smoothing::Taa
    }

    /// Whether glowing meshes light others, so that a scene with some has light.
    pub fn lit_by_glow(&self) -> bool {
        self.indirect.shines()
    }

    /// Whether any technique shoots rays through the scene's trees.
    pub fn shoots_rays(&self) -> bool {
        self.shoots_rays_at_all() || self.shoots_rays_at_mirrors()
    }

    /// Whether any does where something mirrors or refracts.
    pub(crate) fn shoots_rays_at_mirrors(&self) -> bool {
        self.caustics.technique.makes_any() || self.follows_mirrors()
    }

    /// Whether rays follow what mirrors and smooth glass show.
    pub(crate) fn follows_mirrors(&self) -> bool {
        self.specular.technique == SpecularTechnique::Rays
    }

    /// Whether any does whatever a scene holds: caustics have none where nothing mirrors or refracts.
    pub(crate) fn shoots_rays_at_all(&self) -> bool {
        self.shadow.layout == Layout::Traced || self.indirect.technique == Technique::Traced
    }

    /// Which points of a scene imperfect shadow maps are drawn from, where settings ask for some.
    pub fn points(&self) -> Option<PointOptions> {
        self.indirect
            .technique
            .makes_ism()
            .then_some(PointOptions { points: self.indirect.points, seed: self.seed })
    }

    /// The same with nothing left to the adapter.
    #[must_use]
    pub fn resolved(&self, gpu: &Gpu) -> Self {
        self.resolved_for(gpu.rasters_slowly(), gpu.limits.max_storage_buffer_binding_size)
    }

    /// The same by how adapters differ in it.
    fn resolved_for(&self, rasters_slowly: bool, binding_bytes: u64) -> Self {
        let choose = |raster: &mut Raster, fits: bool| {
            if *raster == Raster::Auto {
                *raster = if rasters_slowly && fits { Raster::Compute } else { Raster::Hardware };
            }
        };
        let mut settings = self.effective();
        settings.indirect.technique = settings.indirect.technique.resolved();
        let shadow = &mut settings.shadow;
        choose(&mut settings.surface.raster, true);
        choose(&mut shadow.raster, ComputeRaster::views_in(binding_bytes, [shadow.resolution; 2]) > 0);
        settings
    }

    /// Applies a preset: a name of [`Settings::presets`], or the text of a RON map from keys to values.
    ///
    /// # Errors
    /// When the text is no such map, or a key or value is wrong.
    pub fn apply_preset(&mut self, name: &str, ron_text: Option<&str>) -> Result<(), Error> {
        let fail = |problem: String| Error::Preset { name: name.into(), problem };
        let Some(text) = ron_text else {
            let preset = PRESETS.iter().find(|(known, ..)| *known == name);
            let names = PRESETS.map(|(name, ..)| name).join(", ");
            let (.., keys) =
                preset.ok_or_else(|| fail(format!("there is none of that name; there are {names}")))?;
            return keys.iter().try_for_each(|(key, value)| self.set(key, value));
        };
        let map: std::collections::BTreeMap<String, ron::Value> =
            ron::from_str(text).map_err(|e| fail(format!("line {}: {}", e.span.start.line, e.code)))?;
        for (key, value) in map {
            let value = match value {
                ron::Value::String(text) => text,
                ron::Value::Bool(flag) => flag.to_string(),
                ron::Value::Number(number) => number.into_f64().to_string(),
                other => {
                    return Err(fail(format!("{key}: {other:?} is neither number, text nor true/false")));
                }
            };
            self.set(&key, &value).map_err(|error| fail(error.to_string()))?;
        }
        Ok(())
    }

    /// Built-in presets with a sentence each.
    pub fn presets() -> impl Iterator<Item = (&'static str, &'static str)> {
        PRESETS.into_iter().map(|(name, about, _)| (name, about))
    }
}

#[cfg(test)]
thread_local! {
    /// Whether [`Settings::effective`] leaves everything as it is.
    static LITERALLY: std::cell::Cell<bool> = const { std::cell::Cell::new(false) };
}

/// The keys spelled most alike, nearest first.
fn nearest(key: &str) -> String {
    let mut keys: Vec<_> = Settings::fields().iter().map(|field| field.key.as_str()).collect();
    keys.sort_by(|a, b| strsim::jaro_winkler(key, b).total_cmp(&strsim::jaro_winkler(key, a)));
    keys.truncate(3);
    keys.join(", ")
}

#[cfg(test)]
mod tests;
