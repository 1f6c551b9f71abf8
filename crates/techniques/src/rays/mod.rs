//! Rays through the scene without ray-tracing hardware: two levels of trees that compute shaders walk.
//!
//! A node holds up to eight children, their boxes quantised to eight bits in a grid of its own, in 80 bytes; a ray visits
//! them in the order of its octant, without sorting (Ylitie, Karras & Laine 2017, "Efficient Incoherent Ray Traversal on
//! GPUs Through Compressed Wide BVHs"). obvhs builds: PLOC (Meister & Bittner 2018) with reinsertion (the same, "Parallel
//! Reinsertion"), folded to eight children by the surface area heuristic. All that neither moves nor is drawn many times
//! lies in one tree in world space, and so does every mesh that bends; meshes that are carried about or drawn often have a
//! tree in object space, entered by the ray turned into that space. An upper tree stands over them.
//!
//! Leaves hold the triangles' corners themselves, exact: neighbours share their edges' ends to the bit, and the test
//! computes with those alone (Woop, Benthin & Wald 2013), so that no ray slips between them but where a compiler fuses the
//! products of one edge's two sides differently, which takes a ray that passes the edge within rounding.
//!
//! | input | output | format | unit |
//! | --- | --- | --- | --- |
//! | scene at a pose | `tracer` (of shaders that import `traverse.wesl`) | vec4u | – |
//! | scene group (geometry, clusters, materials, textures: only of masked triangles) | closest or any hit | `Hit` | m |
//!
//! # Motion
//! [`TraceScene::update`] takes a new pose: the upper tree is built anew on the CPU, in the room that it has. Trees of what
//! bends keep their shape; [`Refit`] carries the vertices that `motion` has moved into the leaves, and lays new grids
//! around them from the leaves up: one dispatch per level, no read-back, no allocation on the GPU. Boxes of the upper tree
//! around what bends are those around its joints. Refitted trees are right, but a ray may cost more in them than in ones
//! built for the pose: [`TraceScene::wear`] tells how much, and beyond [`WORN`] they are better built anew.
//!
//! Triangles count from both sides, but for rays that look (`looking` in `traverse.wesl`) not from the back of single-sided
//! materials.
//!
//! Limits: masked triangles are cut out at the finest mip; blended ones count as masked at half coverage, as in shadow
//! maps. A mesh squeezed flat by a node that moves is not met. Triangles that are not finite when a tree is built never
//! are. 128 MiB, which every adapter binds, hold about 2.1 million triangles.
//!
//! Cost: 48 bytes a triangle and about 10 for its share of nodes; what bends 12 more. The build takes about 4 µs a
//! triangle on one core. On an NVIDIA H100 paths are traced 1.3 to 1.8 times as fast as through a binary tree whose
//! triangles lie in the geometry heap, those of one tree about a tenth faster than through several
//! (`docs/decisions/0017-wide-tree.md`).

mod follow;
pub(crate) mod refit;
mod trace;
mod tree;
mod triangle;
mod upper;

pub use follow::Refit;
pub use refit::WORN;
pub use trace::{TraceData, TraceFacts, TraceScene};
pub(crate) use tree::Word;
pub(crate) use triangle::{TriangleRef, cluster_triangles, placed_triangles};
