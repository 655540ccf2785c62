"""Evaluate the equation of motion at one state, including contacts."""

from hpcsweep.kernels.compile import inlined, kernel
from hpcsweep.model.contact import FAR, contact_force
from hpcsweep.solvers.flow.state.contacts import distance


@kernel
def accelerations(ground, z, model, out):
    """Evaluate u'' at one state into `out`, shape (R,), `ground` being G(tau)."""
    n = out.shape[0]
    contacts = model.contacts
    stiffness, damping = model.stiffness, model.damping
    for i in range(n):
        force = model.forcing[i] * ground
        k = contacts.solo[i]
        if k >= 0:
            force -= contacts.sign[k] * push_of(k, z, model)
        out[i] = force
    in_fours = n - n % 4
    for i in range(0, in_fours, 4):
        # four sums wait for their terms together, see `less_linear_of_four`
        first, second, third, fourth = out[i], out[i + 1], out[i + 2], out[i + 3]
        for j in range(n):
            x, v = z[j], z[n + j]
            first -= stiffness[i, j] * x + damping[i, j] * v
            second -= stiffness[i + 1, j] * x + damping[i + 1, j] * v
            third -= stiffness[i + 2, j] * x + damping[i + 2, j] * v
            fourth -= stiffness[i + 3, j] * x + damping[i + 3, j] * v
        out[i], out[i + 1], out[i + 2], out[i + 3] = first, second, third, fourth
    for i in range(in_fours, n):
        force = out[i]
        for j in range(n):
            force -= stiffness[i, j] * z[j] + damping[i, j] * z[n + j]
        out[i] = force
    for other in range(contacts.others.shape[0]):
        k = contacts.others[other]
        force = push_of(k, z, model)
        for p in range(contacts.first[k], contacts.first[k + 1]):
            out[contacts.push_row[p]] -= contacts.push[p] * force


@inlined
def push_of(k, z, model):
    """Evaluate the force of contact k, on its distance, at one state."""
    contacts = model.contacts
    x = distance(k, z, contacts)
    if not model.rho * abs(x) > FAR:
        return contact_force(x, contacts.beta[k], model.rho)
    return contacts.beta[k] * x if x > 0.0 else 0.0
