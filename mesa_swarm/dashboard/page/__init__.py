"""What all tabs share: the session, its inputs, links and widgets."""
