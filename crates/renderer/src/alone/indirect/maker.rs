//! What makes indirect light, and nothing else.

use chiaro_gpu::{GpuError, parallel};
use chiaro_techniques::indirect::bounces::Bounces;
use chiaro_techniques::indirect::clusters::Clusters;
use chiaro_techniques::indirect::foreign::Foreign;
use chiaro_techniques::indirect::gather::{Gather, GatherKey};
use chiaro_techniques::indirect::ism::Ism;
use chiaro_techniques::indirect::points::Points;
use chiaro_techniques::indirect::rsm::Rsm;
use chiaro_techniques::indirect::vpls::Vpls;
use chiaro_techniques::rays::Refit;
use chiaro_techniques::scene::SceneFacts;
use chiaro_techniques::scene::motion::Motion;
use chiaro_techniques::shadow::Lookup;
use chiaro_techniques::shared::albedo_table::AlbedoTable;
use chiaro_techniques::view::culling::Culling;
use chiaro_techniques::view::{SurfaceKey, Surfaces};
use chiaro_techniques::{Kit, Pass};

use crate::indirect::IndirectPasses;
use crate::{Error, Settings};

/// The passes.
#[derive(Debug)]
pub(super) struct Maker {
    pub motion: Motion,
    pub refit: Refit,
    pub foreign: Foreign,
    pub albedo_table: AlbedoTable,
    surfaces: Surfaces,
    culling: Culling,
    rsm: Rsm,
    vpls: Vpls,
    gather: Gather,
    points: Option<Points>,
    ism: Option<Ism>,
    bounces: Option<Bounces>,
    clusters: Option<Clusters>,
}

impl Maker {
    /// Compiles for settings that leave nothing to the adapter, on all cores.
    pub fn compile(kit: &Kit, settings: &Settings, facts: SceneFacts) -> Result<Self, Error> {
        fn work<P: Pass>(kit: &Kit, key: &P::Key, made: &mut Option<Result<P, GpuError>>) {
            *made = Some(P::compile(kit, key));
        }
        let tint = settings.shadow.transmission_tint;
        let draws_maps = settings.points().is_some();
        let gathers = GatherKey::new(&settings.indirect, tint, facts);
        let gathers = gathers.map(|key| GatherKey { sources: false, ..key });
        macro_rules! compile {
            ($($name:ident: $pass:ty = $key:expr;)*) => {{
                $(let mut $name = None;)*
                // What takes longest stands first.
                parallel::all(&mut [$(&mut || work::<$pass>(kit, &$key, &mut $name),)*]);
                $(let Some($name) = $name else { unreachable!("all was done") };)*
                ($($name?,)*)
            }};
        }
        let made = compile! {
            rsm: Rsm = (Lookup::new(&settings.shadow), facts);
            gather: Option<Gather> = gathers;
            surfaces: Surfaces = SurfaceKey::new(&settings.surface, facts);
            ism: Option<Ism> = draws_maps.then_some(false);
            bounces: Option<Bounces> = (settings.indirect.made_bounces() > 1).then_some(());
            clusters: Option<Clusters> = settings.indirect.makes_clusters().then_some(());
            points: Option<Points> = draws_maps.then_some(facts);
            vpls: Vpls = ();
            culling: Culling = ();
            albedo_table: AlbedoTable = ();
            motion: Motion = ();
            refit: Refit = ();
            foreign: Foreign = ();
        };
        let (
            rsm,
            gather,
            surfaces,
            ism,
            bounces,
            clusters,
            points,
            vpls,
            culling,
            albedo_table,
            motion,
            refit,
            foreign,
        ) = made;
        let gather = gather.ok_or(Error::NoPasses)?;
        Ok(Self {
            motion,
            refit,
            foreign,
            albedo_table,
            surfaces,
            culling,
            rsm,
            vpls,
            gather,
            points,
            ism,
            bounces,
            clusters,
        })
    }

    /// Those that indirect light is made by.
    pub fn passes(&self) -> IndirectPasses<'_> {
        IndirectPasses {
            surfaces: &self.surfaces,
            culling: &self.culling,
            rsm: &self.rsm,
            vpls: &self.vpls,
            gather: &self.gather,
            points: self.points.as_ref(),
            ism: self.ism.as_ref(),
            bounces: self.bounces.as_ref(),
            // What glows and surrounds is the host's own.
            sources: None,
            clusters: self.clusters.as_ref(),
            compensate: None,
            accumulate: None,
            pictures: None,
        }
    }
}
