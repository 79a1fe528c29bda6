//! Scratch of the divide-and-conquer algorithm, in the order of the assembly. So each piece uses its own slice of the
//! scratch, and two threads can compute two pieces at the same time.

use crate::divide_conquer::articulated_pair::ArticulatedPair;
use crate::divide_conquer::assembly::{Kind, Link, Piece};
use condyle_spatial::{ArticulatedInertia, Force, Motion, Se3};

/// Quantities of a body, along the world's axes, about a reference point that all bodies of the piece share.
#[derive(Clone, Debug)]
pub(crate) struct Body<S> {
    /// Pose λXi of the body in its parent. Written by: `relate`.
    pub X: Se3<S>,
    /// Pose oXi of the body. Written by: `place`.
    pub oX: Se3<S>,
    /// Velocity of the body. Written by: `place`.
    pub v: Motion<S>,
    /// Velocity-dependent acceleration v × v_J, with the velocity v_J of the joint. Written by: `place`.
    pub c: Motion<S>,
    /// Articulated inertia Iᴬ. Written by: `place`; the elimination of each child adds to it.
    pub IA: ArticulatedInertia<S>,
    /// Articulated bias force pᴬ. Written by: `place`; the elimination of each child adds to it.
    pub pA: Force<S>,
    /// Acceleration of the body. Written by: `accelerate`.
    pub a: Motion<S>,
}

/// Quantities of a degree of freedom, along the world's axes, about a reference point that all bodies of the piece
/// share.
#[derive(Clone, Debug)]
pub(crate) struct Dof<S> {
    /// Joint effort τ. Written by: `aba` and `run`.
    pub tau: S,
    /// Armature. For joints that share a coordinate, the inertia of the rotor in `mimic.rs` is added. Written by: `aba`
    /// and `add_rotors`.
    pub rotor: S,
    /// Joint column S. Written by: `place`.
    pub S: Motion<S>,
    /// Force U = Iᴬ S, with the articulated inertia Iᴬ. Written by: `eliminate`.
    pub U: Force<S>,
    /// Reciprocal of D = Sᵀ U + armature. Written by: `eliminate`.
    pub D_inv: S,
    /// Effort u = τ − Sᵀ pᴬ, with the bias force pᴬ. Written by: `eliminate`, `accelerate`.
    pub u: S,
    /// Joint acceleration. Written by: `accelerate`.
    pub qdd: S,
}

/// Scratch of a piece, including all pieces inside this piece.
pub(crate) struct Part<'d, S> {
    pub pieces: &'d [Piece],
    pub links: &'d [Link],
    pub bodies: &'d mut [Body<S>],
    pub dofs: &'d mut [Dof<S>],
    pub handles: &'d mut [ArticulatedPair<S>],
}

impl<'d, S> Part<'d, S> {
    /// Reborrows the same memory for a shorter lifetime.
    #[inline(always)]
    pub(crate) fn again(&mut self) -> Part<'_, S> {
        let Self { pieces, links, bodies, dofs, handles } = self;
        Part { pieces, links, bodies, dofs, handles }
    }

    /// Splits the scratch into the scratch of the outermost piece alone and the scratch of the pieces inside it.
    #[inline(always)]
    pub(crate) fn open(self) -> (Own<'d, S>, Self) {
        let Piece { kind, open, .. } = self.pieces[0];
        let (n, dofs) = match kind {
            Kind::Run => (self.links.len(), self.dofs.len()),
            Kind::Hub => (1, self.dofs.len() - self.pieces[1].dofs),
            Kind::Join | Kind::Gather => (0, 0),
        };
        let (bodies, dofs) = (self.bodies.split_at_mut(n), self.dofs.split_at_mut(dofs));
        let (handle, handles) = self.handles.split_first_mut().expect("a part has a piece");
        let own = Own { kind, open, links: &self.links[..n], bodies: bodies.0, dofs: dofs.0, handle };
        (own, Self { pieces: &self.pieces[1..], links: &self.links[n..], bodies: bodies.1, dofs: dofs.1, handles })
    }

    /// Splits the scratch into the scratch of the first piece, including all pieces inside it, and the scratch of the
    /// other pieces.
    #[inline(always)]
    pub(crate) fn split(self) -> (Self, Self) {
        let Piece { links: n, dofs, pieces, .. } = self.pieces[0];
        let (bodies, dofs, handles) =
            (self.bodies.split_at_mut(n), self.dofs.split_at_mut(dofs), self.handles.split_at_mut(pieces));
        let (pieces, links) = (self.pieces.split_at(pieces), self.links.split_at(n));
        (
            Self { pieces: pieces.0, links: links.0, bodies: bodies.0, dofs: dofs.0, handles: handles.0 },
            Self { pieces: pieces.1, links: links.1, bodies: bodies.1, dofs: dofs.1, handles: handles.1 },
        )
    }
}

/// Scratch of a piece, without the pieces inside this piece.
pub(crate) struct Own<'d, S> {
    pub kind: Kind,
    pub open: bool,
    pub links: &'d [Link],
    pub bodies: &'d mut [Body<S>],
    pub dofs: &'d mut [Dof<S>],
    pub handle: &'d mut ArticulatedPair<S>,
}
