//! The list of all passes: what is compiled for which settings, and what is missing.

use chiaro_gpu::{GpuError, parallel};
use chiaro_techniques::caustics::photon_trace::PhotonTrace;
use chiaro_techniques::direct::{DirectLight, Permutations};
use chiaro_techniques::indirect::accumulate::Accumulate;
use chiaro_techniques::indirect::bounces::Bounces;
use chiaro_techniques::indirect::clusters::Clusters;
use chiaro_techniques::indirect::compensate::Compensate;
use chiaro_techniques::indirect::gather::{Gather, GatherKey};
use chiaro_techniques::indirect::ism::Ism;
use chiaro_techniques::indirect::pictures::Pictures;
use chiaro_techniques::indirect::points::Points;
use chiaro_techniques::indirect::rsm::Rsm;
use chiaro_techniques::indirect::sources::Sources;
use chiaro_techniques::indirect::vpls::Vpls;
use chiaro_techniques::post::Antialias;
use chiaro_techniques::rays::Refit;
use chiaro_techniques::scene::SceneFacts;
use chiaro_techniques::scene::motion::Motion;
use chiaro_techniques::shadow::{Lookup, ShadowKey, ShadowMaps};
use chiaro_techniques::shared::albedo_table::AlbedoTable;
use chiaro_techniques::specular::SpecularRays;
use chiaro_techniques::transparency::Transparency;
use chiaro_techniques::view::culling::Culling;
use chiaro_techniques::view::{MotionVectors, SurfaceKey, Surfaces};
use chiaro_techniques::{Compiled, Kit, Pass};

use crate::indirect::IndirectPasses;
use crate::{Pipeline, Settings};

/// What is compiled is declared once: a name, a pass, and its key by settings that leave nothing to the adapter and by what
/// scenes use.
macro_rules! passes {
    ($($name:ident: $pass:ty = $key:expr;)*) => {
        /// All passes.
        #[derive(Debug)]
        pub(crate) struct Passes {
            $(pub $name: Compiled<$pass>,)*
        }

        /// What passes that are to be compiled are to be compiled for.
        #[derive(Debug)]
        pub(crate) struct Missing {
            $($name: Option<<$pass as Pass>::Key>,)*
        }

        /// Passes that were missing.
        #[derive(Debug)]
        pub(crate) struct Found {
            $($name: Option<Compiled<$pass>>,)*
        }

        impl Missing {
            /// What `passes`, or none, lack.
            pub fn of(passes: Option<&Passes>, settings: &Settings, facts: SceneFacts) -> Self {
                let missing = Self { $($name: Some($key(settings, facts)),)* };
                let Some(passes) = passes else { return missing };
                Self { $($name: missing.$name.filter(|key| !passes.$name.serves(key)),)* }
            }

            /// Whether nothing is.
            pub fn is_empty(&self) -> bool {
                true $(&& self.$name.is_none())*
            }

            /// Compiles all of it, on all cores, in the order of the list.
            pub fn compile(mut self, kit: &Kit) -> Result<Found, GpuError> {
                $(let mut $name = None;)*
                parallel::all(&mut [$(&mut || {
                    $name = self.$name.take().map(|key| Compiled::<$pass>::new(kit, key));
                },)*]);
                Ok(Found { $($name: $name.transpose()?,)* })
            }
        }

        impl Found {
            /// The passes, where all were missing.
            pub fn into_passes(self) -> Option<Passes> {
                Some(Passes { $($name: self.$name?,)* })
            }

            /// Takes the places of those that did not serve.
            pub fn install(self, passes: &mut Passes) {
                $(if let Some(pass) = self.$name {
                    passes.$name = pass;
                })*
            }
        }
    };
}

// What takes longest to compile stands first.
passes! {
    transparency: Option<Transparency> = |settings: &Settings, facts: SceneFacts| {
        facts.see_through().then(|| (Lookup::new(&settings.shadow), facts))
    };
    direct: DirectLight = permutations;
    surfaces: Surfaces = |settings: &Settings, facts| SurfaceKey::new(&settings.surface, facts);
    shadows: ShadowMaps = |settings: &Settings, facts| ShadowKey::new(&settings.shadow, facts);
    culling: Culling = |_, _| ();
    albedo_table: AlbedoTable = |_, _| ();
    motion: Motion = |_, _| ();
    motion_vectors: MotionVectors = |_, facts: SceneFacts| facts.see_through();
    antialias: Option<Antialias> = |settings: &Settings, _| settings.smooths().then_some(());
    points: Option<Points> = |settings: &Settings, facts| settings.points().is_some().then_some(facts);
    rsm: Option<Rsm> = |settings: &Settings, facts| {
        settings.indirect.technique.makes_vpls().then(|| (Lookup::new(&settings.shadow), facts))
    };
    vpls: Option<Vpls> = |settings: &Settings, _| settings.indirect.technique.makes_vpls().then_some(());
    ism: Option<Ism> = |settings: &Settings, _| {
        settings.points().is_some().then_some(settings.indirect.sources > 0)
    };
    bounces: Option<Bounces> = |settings: &Settings, _| {
        (settings.indirect.made_bounces() > 1 || settings.indirect.scatters()).then_some(())
    };
    sources: Option<Sources> = |settings: &Settings, facts| settings.indirect.shines().then_some(facts);
    clusters: Option<Clusters> = |settings: &Settings, _| settings.indirect.makes_clusters().then_some(());
    compensate: Option<Compensate> = |settings: &Settings, facts| {
        // Bounds come and go without compiling.
        let wanted = settings.indirect.compensate && settings.indirect.technique.makes_vpls();
        wanted.then(|| (Lookup::new(&settings.shadow), facts))
    };
    gather: Option<Gather> = |settings: &Settings, facts| {
        GatherKey::new(&settings.indirect, settings.shadow.transmission_tint, facts)
    };
    accumulate: Option<Accumulate> = |settings: &Settings, _| settings.indirect.accumulates().then_some(());
    pictures: Option<Pictures> = |settings: &Settings, _| {
        settings.indirect.technique.makes_vpls().then_some(())
    };
    photons: Option<PhotonTrace> = |settings: &Settings, facts| {
        settings.caustics.technique.makes_any().then_some(facts)
    };
    specular: Option<SpecularRays> = |settings: &Settings, facts| settings.follows_mirrors().then_some(facts);
    refit: Option<Refit> = |settings: &Settings, _| settings.shoots_rays().then_some(());
}

impl Passes {
    /// Those of indirect light, where settings ask for virtual lights.
    pub fn indirect(&self) -> Option<IndirectPasses<'_>> {
        Some(IndirectPasses {
            surfaces: &self.surfaces,
            culling: &self.culling,
            rsm: self.rsm.as_ref()?,
            vpls: self.vpls.as_ref()?,
            gather: self.gather.as_ref()?,
            points: self.points.as_ref(),
            ism: self.ism.as_ref(),
            bounces: self.bounces.as_ref(),
            sources: self.sources.as_ref(),
            clusters: self.clusters.as_ref(),
            compensate: self.compensate.as_ref(),
            accumulate: self.accumulate.as_ref(),
            pictures: self.pictures.as_ref(),
        })
    }
}

/// What shaders that look up lights are compiled for.
pub(crate) fn permutations(settings: &Settings, facts: SceneFacts) -> Permutations {
    let forward = (settings.pipeline == Pipeline::Forward).then(|| settings.surface.msaa.samples());
    Permutations::new(&settings.shadow, forward, facts)
}
