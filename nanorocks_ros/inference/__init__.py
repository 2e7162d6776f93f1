"""From measured decays and collisions to restitutions: likelihoods, libraries, posteriors."""
