"""What every room stands on: errors, settings, writing files, the mailbox. It knows no sensor."""
