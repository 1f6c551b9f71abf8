//! All settings of all techniques, by key.

use chiaro_gpu::Gpu;
use chiaro_techniques::caustics::CausticsSettings;
use chiaro_techniques::environment::EnvironmentSettings;
use chiaro_techniques::indirect::IndirectSettings;
use chiaro_techniques::post::CameraSettings;
use chiaro_techniques::settings::{Field, SettingsGroup};
use chiaro_techniques::shadow::ShadowSettings;
use chiaro_techniques::surface::raster::ComputeRaster;
use chiaro_techniques::surface::{Raster, SurfaceSettings};

use crate::Error;

/// Which frame function renders.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Pipeline {
    /// A surface buffer, then lighting in compute.
    #[default]
    Deferred,
    /// Lighting in fragments, with MSAA.
    Forward,
}

/// Every technique's settings.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Settings {
    /// Frame function.
    pub pipeline: Pipeline,
    /// What all random choices start from; the same seed and settings give the same image.
    pub seed: u32,
    /// `camera.*`
    pub camera: CameraSettings,
    /// `surface.*`
    pub surface: SurfaceSettings,
    /// `shadow.*`
    pub shadow: ShadowSettings,
    /// `environment.*`
    pub environment: EnvironmentSettings,
    /// `indirect.*`
    pub indirect: IndirectSettings,
    /// `caustics.*`
    pub caustics: CausticsSettings,
}

/// Presets by name: a sentence and the keys they set.
const PRESETS: [(&str, &str, &[(&str, &str)]); 4] = [
    ("default", "what chiaro thinks looks right", &[]),
    (
        "direct",
        "direct light only, as references hold it",
        &[("indirect.technique", "none"), ("caustics.technique", "none")],
    ),
    (
        "fast",
        "for weak GPUs: smaller shadow maps, one-tap filter",
        &[
            ("shadow.resolution", "1024"),
            ("shadow.pcf_kernel", "2"),
            ("surface.anisotropy", "4"),
            ("surface.msaa", "1"),
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

macro_rules! each_group {
    ($settings:expr, $group:ident => $body:expr) => {{
        {
            let $group = &mut $settings.camera;
            $body
        }
        {
            let $group = &mut $settings.surface;
            $body
        }
        {
            let $group = &mut $settings.shadow;
            $body
        }
        {
            let $group = &mut $settings.environment;
            $body
        }
        {
            let $group = &mut $settings.indirect;
            $body
        }
        {
            let $group = &mut $settings.caustics;
            $body
        }
    }};
}

fn set_in<G: SettingsGroup>(group: &mut G, key: &str, value: &str) -> Option<Result<(), String>> {
    let name = key.strip_prefix(G::GROUP)?.strip_prefix('.')?;
    group.set(name, value)
}

fn get_in<G: SettingsGroup>(group: &G, key: &str) -> Option<String> {
    group.get(key.strip_prefix(G::GROUP)?.strip_prefix('.')?)
}

impl Settings {
    /// These settings with nothing left to the adapter.
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
        let mut settings = self.clone();
        let shadow = &mut settings.shadow;
        choose(&mut settings.surface.raster, true);
        choose(&mut shadow.raster, ComputeRaster::views_in(binding_bytes, [shadow.resolution; 2]) > 0);
        settings
    }

    /// Every setting there is, described.
    pub fn fields() -> Vec<Field> {
        let groups = [
            CameraSettings::fields(),
            SurfaceSettings::fields(),
            ShadowSettings::fields(),
            EnvironmentSettings::fields(),
            IndirectSettings::fields(),
            CausticsSettings::fields(),
        ];
        groups.concat()
    }

    /// The value of a key, as text.
    pub fn get(&self, key: &str) -> Option<String> {
        get_in(&self.camera, key)
            .or_else(|| get_in(&self.surface, key))
            .or_else(|| get_in(&self.shadow, key))
            .or_else(|| get_in(&self.environment, key))
            .or_else(|| get_in(&self.indirect, key))
            .or_else(|| get_in(&self.caustics, key))
    }

    /// Sets a key from text.
    ///
    /// # Errors
    /// [`Error::UnknownSetting`] with the nearest keys, [`Error::SettingValue`] with what is allowed.
    pub fn set(&mut self, key: &str, value: &str) -> Result<(), Error> {
        each_group!(self, group => if let Some(outcome) = set_in(group, key, value) {
            return outcome.map_err(|expected| Error::SettingValue { key: key.into(), value: value.into(), expected });
        });
        Err(Error::UnknownSetting { key: key.into(), nearest: nearest(key) })
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

/// The keys spelled most alike, nearest first.
fn nearest(key: &str) -> String {
    let mut keys: Vec<_> = Settings::fields().into_iter().map(|field| field.key).collect();
    keys.sort_by(|a, b| strsim::jaro_winkler(key, b).total_cmp(&strsim::jaro_winkler(key, a)));
    keys.truncate(3);
    keys.join(", ")
}

#[cfg(test)]
mod tests {
    use chiaro_techniques::settings::Kind;

    use super::*;

    #[test]
    fn every_listed_key_can_be_read_and_set_to_its_default() {
        let mut settings = Settings::default();
        for field in Settings::fields() {
            assert_eq!(settings.get(&field.key).as_ref(), Some(&field.default), "{}", field.key);
            settings.set(&field.key, &field.default).unwrap();
        }
        assert_eq!(settings, Settings::default());
    }

    #[test]
    fn left_to_the_adapter_maps_that_compute_has_no_room_for_are_rastered_by_the_hardware() {
        let mut settings = Settings::default();
        let choice = |settings: &Settings| settings.resolved_for(true, 128 << 20).shadow.raster;
        settings.shadow.resolution = 4096;
        assert_eq!(choice(&settings), Raster::Compute);
        settings.shadow.resolution = 8192;
        assert_eq!(choice(&settings), Raster::Hardware);
        settings.shadow.raster = Raster::Compute;
        assert_eq!(choice(&settings), Raster::Compute);
    }

    #[test]
    fn an_unknown_key_names_the_nearest() {
        let message = Settings::default().set("shadow.resolutoin", "1").unwrap_err().to_string();
        assert!(message.contains("shadow.resolution"), "{message}");
    }

    #[test]
    fn the_thesis_shadows_have_no_highlights_back_faces_and_the_most_anisotropy() {
        let mut settings = Settings::default();
        settings.apply_preset("thesis-shadows", None).unwrap();
        let is = |key: &str, value: &str| assert_eq!(settings.get(key).as_deref(), Some(value), "{key}");
        is("surface.lighting", "lambert");
        is("shadow.bias.cull_front", "true");
        is("shadow.sigma", "1.79");
        for key in ["surface.anisotropy", "shadow.anisotropy"] {
            let field = Settings::fields().into_iter().find(|field| field.key == key).unwrap();
            let Kind::Whole(_, most) = field.kind else { panic!("{key}") };
            is(key, &most.to_string());
        }
    }

    #[test]
    fn presets_are_valid_and_files_take_keys_as_set_does() {
        for (name, _) in Settings::presets() {
            Settings::default().apply_preset(name, None).unwrap();
        }
        let mut settings = Settings::default();
        let file = r#"{ "shadow.resolution": 512, "shadow.filter": "none", "surface.normal_maps": false }"#;
        settings.apply_preset("file", Some(file)).unwrap();
        assert_eq!(settings.shadow.resolution, 512);
        assert!(!settings.surface.normal_maps);
        let wrong = settings.apply_preset("file", Some("{ \"shadow.resolution\": ")).unwrap_err().to_string();
        assert!(wrong.contains("line 1"), "{wrong}");
    }
}
