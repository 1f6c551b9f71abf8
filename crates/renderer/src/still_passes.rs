//! What stills are made with beside frames.

use chiaro_gpu::shader::Library;
use chiaro_gpu::{GpuError, parallel};
use chiaro_techniques::Kit;
use chiaro_techniques::direct::Permutations;
use chiaro_techniques::post::{Accumulator, AovPass, Display};

/// Passes beside those of frames, kept from one still to the next.
#[derive(Debug)]
pub(crate) struct StillPasses {
    library: Library,
    pub accumulator: Accumulator,
    pub display: Display,
    /// What they were compiled for, and for how many quantities.
    pub aovs: Option<((Permutations, usize), AovPass)>,
}

impl StillPasses {
    /// Takes over what serves, and compiles what is missing. A still of no quantity leaves the passes of the one before.
    pub fn new(kept: Option<Self>, kit: &Kit, wanted: (Permutations, usize)) -> Result<Self, GpuError> {
        let Kit { gpu, library, .. } = kit;
        let kept = kept.filter(|kept| kept.library.is(library));
        let (plain, aovs) = match kept {
            Some(Self { accumulator, display, aovs, .. }) => (Some((accumulator, display)), aovs),
            None => (None, None),
        };
        let (permutations, count) = wanted;
        let aovs = aovs.filter(|(has, _)| count == 0 || *has == wanted);
        let lacks = count > 0 && aovs.is_none();
        let (made, plain) = parallel::join(
            || lacks.then(|| AovPass::new(kit, permutations, count)).transpose(),
            || {
                let compile = || {
                    let (accumulator, display) =
                        parallel::join(|| Accumulator::new(gpu, library), || Display::new(gpu, library));
                    Ok::<_, GpuError>((accumulator?, display?))
                };
                plain.map_or_else(compile, Ok)
            },
        );
        let (accumulator, display) = plain?;
        let aovs = made?.map(|pass| (wanted, pass)).or(aovs);
        Ok(Self { library: library.clone(), accumulator, display, aovs })
    }
}
